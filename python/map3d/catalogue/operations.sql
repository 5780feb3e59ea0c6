-- Statements on operations, by name.

-- create
INSERT INTO operation(kind, target, scene, arguments, state, asked_by, created)
VALUES (:kind, :target, :scene, :arguments, 'waiting', :asked_by, now_s())
RETURNING *;

-- scene_of_rendering
SELECT scene FROM rendering WHERE name = :target;

-- scene
SELECT name FROM scene WHERE name = :target;

-- too_many_ended
SELECT number FROM operation WHERE state IN ('done', 'failed', 'cancelled') ORDER BY number DESC LIMIT -1 OFFSET :kept;

-- remove_log
DELETE FROM operation_log WHERE operation = :number;

-- remove
DELETE FROM operation WHERE number = :number;

-- operation
SELECT * FROM operation WHERE number = :number;

-- operations
SELECT * FROM operation WHERE (:target IS NULL OR target = :target) AND (:scene IS NULL OR scene = :scene)
  AND (:before IS NULL OR number < :before) AND (:states IS NULL OR state IN (SELECT value FROM json_each(:states)))
ORDER BY number DESC LIMIT :limit;

-- any_unended
SELECT 1 FROM operation WHERE state IN ('waiting', 'running') LIMIT 1;

-- expire
UPDATE operation SET worker = NULL, expires = NULL, fence = fence + 1, expiries = expiries + 1, cancelling = 0,
  ended = iif(cancelling OR expiries + 1 >= :max_expiries, now_s(), NULL),
  message = CASE WHEN cancelling THEN :cancelled WHEN expiries + 1 >= :max_expiries THEN :expired ELSE message END,
  state = CASE WHEN cancelling THEN 'cancelled' WHEN expiries + 1 >= :max_expiries THEN 'failed' ELSE 'waiting' END
WHERE state = 'running' AND (:number IS NULL OR number = :number) AND iif(:worker IS NULL, expires < now_s(), worker = :worker);

-- lease
UPDATE operation SET state = 'running', worker = :worker, fence = fence + 1, expires = now_s() + :lease_s, started = coalesce(started, now_s())
WHERE number = (SELECT min(number) FROM operation AS waiting WHERE state = 'waiting'
  AND NOT EXISTS (SELECT 1 FROM operation AS running WHERE running.scene = waiting.scene AND running.state = 'running'))
RETURNING *;

-- heartbeat
UPDATE operation SET expires = now_s() + :lease_s, stage = :stage, done = :done, total = :total
WHERE number = :number AND state = 'running' AND fence = :fence AND expires >= now_s()
RETURNING cancelling;

-- count_lines
UPDATE operation SET lines = lines + :lines
WHERE number = :number AND state = 'running' AND fence = :fence AND expires >= now_s()
RETURNING lines;

-- append_line
INSERT INTO operation_log VALUES (:operation, :number, now_s(), :text);

-- remove_lines
DELETE FROM operation_log WHERE operation = :operation AND number > :after AND number <= :until;

-- log
SELECT * FROM operation_log WHERE operation = :number AND number > :after ORDER BY number LIMIT :limit;

-- end
UPDATE operation SET state = :state, message = :message, ended = now_s(), worker = NULL, expires = NULL, cancelling = 0
WHERE number = :number AND state = 'running' AND fence = :fence AND expires >= now_s();

-- has_ended
SELECT 1 FROM operation WHERE number = :number AND state = :state AND fence = :fence;

-- release
UPDATE operation SET state = iif(cancelling, 'cancelled', 'waiting'), ended = iif(cancelling, now_s(), NULL),
  message = iif(cancelling, :cancelled, message), worker = NULL, expires = NULL, cancelling = 0
WHERE number = :number AND state = 'running' AND fence = :fence AND expires >= now_s();

-- cancel_waiting
UPDATE operation SET state = 'cancelled', ended = now_s(), message = :cancelled WHERE number = :number AND state = 'waiting';

-- cancel_running
UPDATE operation SET cancelling = 1 WHERE number = :number AND state = 'running';

-- retry
UPDATE operation SET state = 'waiting', worker = NULL, expires = NULL, cancelling = 0, expiries = 0, stage = '', done = 0, total = 0, message = '',
  started = NULL, ended = NULL
WHERE number = :number AND state IN ('failed', 'cancelled');
