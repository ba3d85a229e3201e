-- The workloads of budget.rs in Lua. Prints the milliseconds of the measured part, or bytes.
local function fib(n) if n < 2 then return n end return fib(n - 1) + fib(n - 2) end
local function tak(x, y, z)
  if y >= x then return z end
  return tak(tak(x - 1, y, z), tak(y - 1, z, x), tak(z - 1, x, y))
end
local function cons(a, b) return { a, b } end
local function join(a, b) if a == nil then return b end return cons(a[1], join(a[2], b)) end
local function ok(row, dist, placed)
  if placed == nil then return true end
  local p = placed[1]
  return p ~= row + dist and p ~= row - dist and ok(row, dist + 1, placed[2])
end
local function try(x, y, z)
  if x == nil then return y == nil and 1 or 0 end
  local r = 0
  if ok(x[1], 1, z) then r = try(join(x[2], y), nil, cons(x[1], z)) end
  return r + try(x[2], cons(x[1], y), z)
end
local function upto(n) local l = nil for i = n, 1, -1 do l = cons(i, l) end return l end
local function closures(n)
  local acc = 0
  for i = 0, n - 1 do local f = function(x) return (x + i) % 1000003 end acc = f(acc) end
  return acc
end
-- As many coroutines in all, so many at a time: each waits for one event, then ends.
local function park(n)
  local done = 0
  for _ = 1, math.floor(100000 / n) do
    local tasks = {}
    for i = 1, n do
      local task = coroutine.create(function() done = done + coroutine.yield() end)
      coroutine.resume(task)
      tasks[i] = task
    end
    for i = 1, n do coroutine.resume(tasks[i], 1) end
  end
  return done
end
-- What a coroutine that waits takes.
local function bytes(n)
  local tasks = {}
  collectgarbage()
  local before = collectgarbage("count")
  for i = 1, n do
    tasks[i] = coroutine.create(function() coroutine.yield(tasks) end)
    coroutine.resume(tasks[i])
  end
  return (collectgarbage("count") - before) * 1024 / n
end
local function hand_off(n)
  local other = coroutine.create(function() while true do coroutine.yield() end end)
  for _ = 1, n do coroutine.resume(other) end
end
local workloads = {
  park10 = function() return park(10) end,
  park1000 = function() return park(1000) end,
  park100000 = function() return park(100000) end,
  ["hand-off"] = function() return hand_off(50000) end,
  fib30 = function() return fib(30) end,
  tak = function() return tak(24, 16, 8) end,
  queens10 = function() return try(upto(10), nil, nil) end,
  closure = function() return closures(1000000) end,
}
if arg[1] == "bytes" then
  print(bytes(100000))
  return
end
if not workloads[arg[1]] then return end
local start = os.clock()
workloads[arg[1]]()
print((os.clock() - start) * 1000)
