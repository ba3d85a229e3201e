//! The tables of a store. The texts below are compared with what a file has: a file with other tables, or with
//! a trigger, is not used.

/// The number of the format, in the file as `user_version`.
pub const FORMAT: i64 = 1;
/// What tells a store from other SQLite files, as `application_id`: "PLCH".
pub const APPLICATION: i64 = 0x504c_4348;

/// Name and text of each table.
pub const TABLES: &[(&str, &str)] = &[
    (
        "versions",
        "CREATE TABLE versions (
  id INTEGER PRIMARY KEY, tree TEXT NOT NULL, version INTEGER NOT NULL, base INTEGER,
  batches INTEGER NOT NULL, slots INTEGER NOT NULL, records INTEGER NOT NULL, edits INTEGER NOT NULL,
  entries INTEGER NOT NULL, steps INTEGER NOT NULL, sum INTEGER NOT NULL,
  UNIQUE (tree, version)
) STRICT",
    ),
    (
        "runs",
        "CREATE TABLE runs (
  id INTEGER PRIMARY KEY, file TEXT NOT NULL, plan TEXT, program TEXT NOT NULL, seed TEXT NOT NULL,
  schedule TEXT NOT NULL, robot TEXT NOT NULL, head TEXT NOT NULL, outcome TEXT NOT NULL, value TEXT,
  clock_ns INTEGER NOT NULL, sum INTEGER NOT NULL
) STRICT",
    ),
    (
        "programs",
        "CREATE TABLE programs (
  program TEXT NOT NULL, file TEXT NOT NULL, hash TEXT NOT NULL, source TEXT, sum INTEGER NOT NULL,
  PRIMARY KEY (program, file)
) STRICT, WITHOUT ROWID",
    ),
    (
        "batches",
        "CREATE TABLE batches (
  id INTEGER NOT NULL, batch INTEGER NOT NULL, slots INTEGER NOT NULL, records INTEGER NOT NULL,
  entries INTEGER NOT NULL, steps INTEGER NOT NULL, sum INTEGER NOT NULL,
  PRIMARY KEY (id, batch)
) STRICT, WITHOUT ROWID",
    ),
    (
        "log",
        "CREATE TABLE log (
  id INTEGER NOT NULL, entry INTEGER NOT NULL, round INTEGER NOT NULL, step INTEGER NOT NULL,
  clock_ns INTEGER NOT NULL, events TEXT NOT NULL, sum INTEGER NOT NULL,
  PRIMARY KEY (id, entry)
) STRICT, WITHOUT ROWID",
    ),
    (
        "slots",
        "CREATE TABLE slots (
  id INTEGER NOT NULL, slot INTEGER NOT NULL, parent INTEGER NOT NULL, name TEXT NOT NULL,
  site TEXT NOT NULL, steps TEXT NOT NULL, place INTEGER NOT NULL, sum INTEGER NOT NULL,
  PRIMARY KEY (id, slot)
) STRICT, WITHOUT ROWID",
    ),
    (
        "records",
        "CREATE TABLE records (
  id INTEGER NOT NULL, record INTEGER NOT NULL, slot INTEGER NOT NULL, parent INTEGER NOT NULL,
  attempt INTEGER NOT NULL, kind TEXT NOT NULL, status TEXT NOT NULL, why TEXT NOT NULL,
  start_ns INTEGER NOT NULL, end_ns INTEGER, params TEXT NOT NULL, value TEXT, failure TEXT, more TEXT,
  sum INTEGER NOT NULL,
  PRIMARY KEY (id, record)
) STRICT, WITHOUT ROWID",
    ),
    (
        "edits",
        "CREATE TABLE edits (
  id INTEGER NOT NULL, number INTEGER NOT NULL, slot INTEGER NOT NULL, edit TEXT NOT NULL,
  callee TEXT NOT NULL, after TEXT NOT NULL, origin TEXT NOT NULL, orphan TEXT, sum INTEGER NOT NULL,
  PRIMARY KEY (id, number)
) STRICT, WITHOUT ROWID",
    ),
    (
        "decisions",
        "CREATE TABLE decisions (
  id INTEGER NOT NULL, number INTEGER NOT NULL, what TEXT NOT NULL, decision TEXT NOT NULL,
  why TEXT NOT NULL, numbers TEXT NOT NULL, sum INTEGER NOT NULL,
  PRIMARY KEY (id, number)
) STRICT, WITHOUT ROWID",
    ),
];

/// Name and text of each view. They are for people: nothing here reads them.
pub const VIEWS: &[(&str, &str)] = &[
    (
        "history",
        "CREATE VIEW history AS
SELECT versions.id, tree, version, file, plan, seed, schedule, robot, outcome, value, clock_ns / 1e9 AS clock_s,
  steps, records AS nodes, edits
FROM versions LEFT JOIN runs ON runs.id = versions.id ORDER BY versions.id",
    ),
    (
        "tasks",
        "CREATE VIEW tasks AS
SELECT tree, version, records.record, records.slot, slots.parent AS parent_slot, slots.name, kind, status, why,
  attempt, start_ns / 1e9 AS start_s, end_ns / 1e9 AS end_s, (end_ns - start_ns) / 1e9 AS seconds, params, value,
  failure
FROM versions JOIN records ON records.id = versions.id
JOIN slots ON slots.id = records.id AND slots.slot = records.slot ORDER BY versions.id, records.record",
    ),
    (
        "changes",
        "CREATE VIEW changes AS
SELECT tree, version, number, slots.name, edit, origin, orphan
FROM edits JOIN versions ON versions.id = edits.id
LEFT JOIN slots ON slots.id = edits.id AND slots.slot = edits.slot ORDER BY versions.id, number",
    ),
];
