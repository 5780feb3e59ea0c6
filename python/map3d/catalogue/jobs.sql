-- Statements on jobs, by name. After the name: the events of states.py that the statement does. A test compares their states.

-- expire_overdue: expire
UPDATE job SET state = iif(expiries + 1 >= :max_expiries, 'quarantined', 'todo'), attempts = attempts - 1, expiries = expiries + 1,
  worker = NULL, expires = NULL, reason = json_object('code', 'lease-expired', 'values', json_object('count', expiries + 1, 'worker', worker))
WHERE state = 'leased' AND expires < now_s();

-- expire_worker: expire
UPDATE job SET state = iif(expiries + 1 >= :max_expiries, 'quarantined', 'todo'), attempts = attempts - 1, expiries = expiries + 1,
  worker = NULL, expires = NULL, reason = json_object('code', 'lease-expired', 'values', json_object('count', expiries + 1, 'worker', worker))
WHERE state = 'leased' AND rendering = :rendering AND worker = :worker;

-- lease: lease
UPDATE job SET state = 'leased', attempts = attempts + 1, fence = fence + 1, worker = :worker, leased = now_s(), expires = now_s() + :lease_s
WHERE rowid = coalesce(
  (SELECT rowid FROM job WHERE rendering = :rendering AND state = 'todo' AND ground >= :start
    AND (attempts + expiries, z) = (SELECT attempts + expiries, z FROM job WHERE rendering = :rendering AND state = 'todo'
      ORDER BY attempts + expiries, z, ground, track, morton LIMIT 1)
    ORDER BY ground, track, morton LIMIT 1),
  (SELECT rowid FROM job WHERE rendering = :rendering AND state = 'todo' ORDER BY attempts + expiries, z, ground, track, morton LIMIT 1))
RETURNING *, (SELECT content_version FROM rendering WHERE name = rendering) AS content_version;

-- lease_block: lease
UPDATE job SET state = 'leased', attempts = attempts + 1, fence = fence + 1, worker = :worker, leased = now_s(), expires = now_s() + :lease_s
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state = 'todo'
RETURNING *, (SELECT content_version FROM rendering WHERE name = rendering) AS content_version;

-- evict: evict
UPDATE job SET state = 'leased', attempts = 1, expiries = 0, fence = fence + 1, worker = :worker, leased = now_s(), expires = now_s() + :lease_s
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state = 'done' AND kind = 'base'
  AND EXISTS (SELECT 1 FROM job_count AS other WHERE other.rendering = :rendering AND other.state <> 'done' AND other.jobs > 0)
RETURNING *, (SELECT content_version FROM rendering WHERE name = rendering) AS content_version;

-- heartbeat: heartbeat
UPDATE job SET expires = now_s() + :lease_s
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y)
  AND state = 'leased' AND fence = :fence AND worker = :worker AND expires >= now_s()
RETURNING *;

-- done: done
UPDATE job SET state = 'done', worker = NULL, expires = NULL, ended = now_s(), reason = NULL, version = :version, empty = :empty, tiles = :tiles,
  base_tiles = :base_tiles, bytes = :bytes, seconds = :seconds, occupied = :occupied
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y)
  AND state = 'leased' AND fence = :fence AND worker = :worker AND expires >= now_s()
RETURNING *;

-- fail: fail
UPDATE job SET state = iif(attempts >= :max_attempts, 'quarantined', 'todo'), worker = NULL, expires = NULL, reason = :reason
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y)
  AND state = 'leased' AND fence = :fence AND worker = :worker AND expires >= now_s()
RETURNING *;

-- release: release
UPDATE job SET state = 'todo', attempts = attempts - 1, worker = NULL, expires = NULL
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y)
  AND state = 'leased' AND fence = :fence AND worker = :worker AND expires >= now_s()
RETURNING *;

-- insert
INSERT INTO job(rendering, track, z, x, y, kind, morton, key, parent_z, parent_x, parent_y, state, fence, ground)
VALUES (:rendering, :track, :z, :x, :y, :kind, :morton, :key, :parent_z, :parent_x, :parent_y, iif(:kind = 'base', 'todo', 'waiting'), :fence, :ground);

-- change: key changed, plan
-- Increments the fence too, so that a worker that still renders the old state loses its lease.
UPDATE job SET state = iif(kind = 'base', 'todo', 'waiting'), key = :key, ground = :ground, fence = fence + 1,
  attempts = 0, expiries = 0, worker = NULL, expires = NULL, reason = NULL
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y);

-- wait_again: below reopened
UPDATE job SET state = 'waiting', fence = fence + 1, attempts = 0, expiries = 0, worker = NULL, expires = NULL, reason = NULL
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state IN ('todo', 'leased', 'done');

-- wait_again_unless_done: below reopened
UPDATE job SET state = 'waiting', fence = fence + 1, attempts = 0, expiries = 0, worker = NULL, expires = NULL, reason = NULL
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state IN ('todo', 'leased');

-- sweep: below done
UPDATE job SET state = 'todo'
WHERE rendering = :rendering AND state = 'waiting' AND NOT EXISTS (SELECT 1 FROM job AS below WHERE below.state <> 'done'
  AND (below.rendering, below.track, below.parent_z, below.parent_x, below.parent_y) = (job.rendering, job.track, job.z, job.x, job.y));

-- open_above: below done
UPDATE job SET state = 'todo'
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state = 'waiting' AND NOT EXISTS (SELECT 1 FROM job AS below
  WHERE below.state <> 'done'
  AND (below.rendering, below.track, below.parent_z, below.parent_x, below.parent_y) = (job.rendering, job.track, job.z, job.x, job.y));

-- retry_all: retry
UPDATE job SET state = iif(kind = 'base', 'todo', 'waiting'), attempts = 0, expiries = 0
WHERE rendering = :rendering AND state IN ('quarantined', 'cancelled');

-- retry: retry
UPDATE job SET state = iif(kind = 'base', 'todo', 'waiting'), attempts = 0, expiries = 0
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state IN ('quarantined', 'cancelled');

-- cancel_all: cancel
UPDATE job SET state = 'cancelled', fence = fence + 1, attempts = 0, expiries = 0, worker = NULL, expires = NULL, reason = NULL
WHERE rendering = :rendering AND state IN ('waiting', 'todo', 'leased');

-- cancel: cancel
UPDATE job SET state = 'cancelled', fence = fence + 1, attempts = 0, expiries = 0, worker = NULL, expires = NULL, reason = NULL
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state IN ('waiting', 'todo', 'leased');

-- reopen: reopen
UPDATE job SET state = iif(kind = 'base', 'todo', 'waiting'), fence = fence + 1,
  attempts = 0, expiries = 0, worker = NULL, expires = NULL, reason = NULL
WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y) AND state = 'done';

-- page
SELECT * FROM job WHERE rendering = :rendering AND (track, z, morton, x, y) > (:track, :z, :morton, :x, :y) AND (:state IS NULL OR state = :state)
ORDER BY track, z, morton, x, y LIMIT :page;

-- page_of_track
SELECT * FROM job WHERE rendering = :rendering AND track = :track AND (z, morton, x, y) > (:z, :morton, :x, :y) AND (:state IS NULL OR state = :state)
ORDER BY track, z, morton, x, y LIMIT :page;

-- in_state
SELECT * FROM job INDEXED BY job_next WHERE rendering = :rendering AND state = :state AND (:track IS NULL OR track = :track)
ORDER BY track, z, morton, x, y;

-- below
SELECT * FROM job WHERE (rendering, track, parent_z, parent_x, parent_y) = (:rendering, :track, :z, :x, :y) ORDER BY morton;

-- job
SELECT * FROM job WHERE (rendering, track, z, x, y) = (:rendering, :track, :z, :x, :y);

-- counts
SELECT state, jobs FROM job_count WHERE rendering = :rendering;

-- any_open
SELECT 1 FROM job WHERE rendering = :rendering AND state IN ('waiting', 'todo', 'leased') LIMIT 1;

-- any_leasable
SELECT 1 FROM job WHERE rendering = :rendering AND state IN ('todo', 'leased') LIMIT 1;

-- begin_plan
UPDATE rendering SET planning = 1 WHERE name = :rendering;

-- end_plan
UPDATE rendering SET planning = 0 WHERE name = :rendering AND planning;

-- raise_version
UPDATE rendering SET content_version = announced_version + 1 WHERE name = :rendering AND announced_version >= content_version;

-- version
SELECT content_version FROM rendering WHERE name = :rendering;
