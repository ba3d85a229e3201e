//! The tables of a store. The texts below are compared with what a file has: a file with other tables, or with
//! a trigger, is not used.

/// The number of the format, in the file as `user_version`.
pub const FORMAT: i64 = 2;
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
        "chunks",
        "CREATE TABLE chunks (
  id INTEGER NOT NULL, what TEXT NOT NULL, first INTEGER NOT NULL, count INTEGER NOT NULL,
  sum INTEGER NOT NULL, words TEXT NOT NULL, content TEXT NOT NULL,
  PRIMARY KEY (id, what, first)
) STRICT",
    ),
    (
        "outlines",
        "CREATE TABLE outlines (
  id INTEGER PRIMARY KEY, batch INTEGER NOT NULL, sum INTEGER NOT NULL, words TEXT NOT NULL, tasks BLOB NOT NULL
) STRICT",
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
        "slots",
        "CREATE VIEW slots AS
SELECT chunks.id AS id, first + row.key AS slot, json_extract(row.value, '$[0]') AS parent,
  json_extract(words, '$[' || json_extract(row.value, '$[1]') || ']') AS name,
  json_extract(words, '$[' || json_extract(row.value, '$[2]') || ']') AS site,
  nullif(json_extract(row.value, '$[4]'), 0) AS steps, first + row.key + json_extract(row.value, '$[3]') AS place
FROM chunks, json_each(content) AS row WHERE what = 'slots'",
    ),
    (
        "records",
        "CREATE VIEW records AS
SELECT chunks.id AS id, first + row.key AS record, first + row.key + json_extract(row.value, '$[0]') AS slot,
  json_extract(row.value, '$[1]') AS parent, json_extract(row.value, '$[2]') AS attempt,
  json_extract(words, '$[' || json_extract(row.value, '$[3]') || ']') AS name,
  json_extract(words, '$[' || json_extract(row.value, '$[4]') || ']') AS kind,
  json_extract(words, '$[' || json_extract(row.value, '$[5]') || ']') AS status,
  json_extract(words, '$[' || json_extract(row.value, '$[6]') || ']') AS why,
  json_extract(row.value, '$[7]') AS start_ns, json_extract(row.value, '$[8]') AS end_ns,
  nullif(json_extract(row.value, '$[9]'), 0) AS params, nullif(json_extract(row.value, '$[10]'), 0) AS value,
  nullif(json_extract(row.value, '$[11][0]'), 0) AS failure, nullif(json_extract(row.value, '$[11][1]'), 0) AS more
FROM chunks, json_each(content) AS row WHERE what = 'records'",
    ),
    (
        "tasks",
        "CREATE VIEW tasks AS
SELECT tree, version, record, slot, parent, name, kind, status, why, attempt, start_ns / 1e9 AS start_s,
  end_ns / 1e9 AS end_s, (end_ns - start_ns) / 1e9 AS seconds, params, value, failure
FROM versions JOIN records ON records.id = versions.id",
    ),
    (
        "changes",
        "CREATE VIEW changes AS
SELECT tree, version, number, (
    SELECT json_extract(words, '$[' || json_extract(content, '$[' || (slot - first) || '][1]') || ']')
    FROM chunks WHERE chunks.id = edits.id AND what = 'slots' AND first <= slot AND slot < first + count
  ) AS name, edit, origin, orphan
FROM edits JOIN versions ON versions.id = edits.id ORDER BY versions.id, number",
    ),
];
