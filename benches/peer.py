# The workloads of budget.rs that generators can do. Prints the milliseconds of the measured part, or bytes.
import sys
import time


def task(done):
    done[0] += yield


def start(n, done):
    tasks = [task(done) for _ in range(n)]
    for it in tasks:
        next(it)
    return tasks


# As many tasks in all, so many at a time: each waits for one event, then ends.
def park(n):
    done = [0]
    for _ in range(100_000 // n):
        for it in start(n, done):
            try:
                it.send(1)
            except StopIteration:
                pass


def echo():
    while True:
        yield


def hand_off(n):
    other = echo()
    for _ in range(n):
        next(other)


def resident():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * 4096


def main(workload):
    if workload == "bytes":
        before, n = resident(), 100_000
        tasks = start(n, [0])
        return (resident() - before) / len(tasks)
    workloads = {
        "park10": lambda: park(10),
        "park1000": lambda: park(1000),
        "park100000": lambda: park(100_000),
        "hand-off": lambda: hand_off(50_000),
    }
    if workload not in workloads:
        return None
    before = time.process_time()
    workloads[workload]()
    return (time.process_time() - before) * 1000


found = main(sys.argv[1])
if found is not None:
    print(found)
