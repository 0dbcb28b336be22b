"""Words of records that people read in their language: names of fields, and codes of outcomes and refusals.

Each is a key of the catalogue of sentences, with blanks in place of underscores. Other words stay as they are.
Words of one kind of task stand in its `TaskKind`.
"""

from robots.shared.wire import TASK_KINDS

_NAMES = """
accepted, account_inactive, added, address, allowed, already_yours, angle, archived, arm_away, asked, awaiting, away,
base_moving, before, behind_unseen, blind_direction, book_first, booked, booking, bridge, bridge_down, bridge_ended,
bridge_lost, bridge_silent, bridge_unreachable, browser, busy, by, camera, camera_ended, camera_hung, camera_silent,
camera_starts, cancelled, cause, changed, changes, clear, closed, code, confirmed, connection_lost, control_ended,
course, course_over, days, dead_man, dead-man, depth_stale, distance, done, drive, duration, email, enabled, ends,
ends_at, expires_at, failed, finished, flood, free, from, full_name, given_up, goes_on, granted, group, groups,
halted, handed_over, head_away, heading, held, holder_name, inspector_silent, invalid, invitation_expired,
invitation_revoked, invitation_used, is_active, is_staff, is_superuser, kinds, language, latched, latency, lease_over,
limb, limit, link_fault, link_lost, map, master_uri, method, moved, name, near_miss, neutral_needed, next_in_line,
no_answer, no_camera, no_head, no_lease, no_map, no_role, no_show, not_allowed, not_cleared, not_found, not_holder,
not_in_control, not_recorded, not_watched, note, number, obstacle, odometry_anew, odometry_missing, odometry_stale,
of, offer_over, offered, old_fence, other_robot, out_of_service, over, overtaken, page, password, pending, people,
person, person_name, place, place_unknown, points, practice, profile, program, project, purpose, qualification,
reason, refused, rejected, released, removed, replaced, right, robot_disabled, robot_offline, robot_page,
robot_silent, role, role_lowered, role_too_low, rule, scan_missing, scan_stale, scan_unpaired, scope_missing, scopes,
sent, signed_out, slot, sonar_stale, speed, standstill, starts, starts_at, stopped, stopped_again, stopping,
succeeded, superseded, tags, taken, taken_over, term, text, texts, through, time_zone, times, to, too_deep, too_far,
too_fast, too_large, too_late, too_many, too_old, top, type, unheard, unknown, unqualified, until, use, username,
was_standing, what, why, wrong_course, account, arm, audit, base, call, choose, database, error, gate, gripper, head,
lease, limits, motions, observer, ok, operator, publish, rest, robot, set, silent, speech, staff, stop, supervisor,
torso, warning, wire, actor, address_digest, also, at, bearing, because, connection, digest, entry, expires, factor,
field, fields, figures, format, holder, host, interventions, invitation, left, lesson, list, made_with, map_to_odom,
most_uses, motion, name_digest, nearest, override, part, parts, path, period, pose, publishers, records, request,
robots, rows, sensor, service, side, since, stays, supervisors, tab, token, topic, user, value, webhook, words,
around_the_gate, backwards, bad_definition, bad_description, bad_field, bad_picture, bridge_fault,
bridge_unresolvable, broken, definition_differs, duplicate_field, fence_taken, held_away, hello_first, hello_twice,
if_match_missing, in_past, in_progress, inspector_fault, key_reused, may_not_clear, method_not_allowed, more_than_own,
name_alike, name_mixed, name_reserved, name_taken, name_unseen, no_account, no_colleague, no_invitation, no_listener,
no_message, no_outline, no_parameter, no_programs, no_publisher, no_reason, no_service, no_such_request,
no_such_robot, not_connected, not_for_others, not_json, not_offered, not_text, not_utf8, not_yours, other_link,
other_process, other_robots, out_of_order, outcome_unknown, password_needed, permission_denied, protocol,
publishers_differ, recording, robot_misdescribed, robot_needed, role_of_control, service_failed, service_lost,
service_silent, somebody_asks, state_not_saved, time_gap, time_twice, too_long, too_many_keys, too_many_subscriptions,
too_much, too_often, type_unknown, waits_enough, watchdog_missing, wrong_type, wrong_year, zero_length,
may_not_drive, minutes, missed, no_line, no_such_turn, not_in_lesson, not_teacher,
not_your_turn, seconds, shared, skipped, somebody_waits, teacher, team, team_size, turn_min,
anew, has_account, mail_off, not_on_list, own_link_needed,
archive, bytes, encrypted, kept, made_at,
record, recordings, person_quota, robot_quota, recording_goes_on, disk_full, quota_full
"""
_CODES = {name.strip() for name in _NAMES.split(",")}.union(*(kind.words.split() for kind in TASK_KINDS))
WORDS = frozenset(code.replace("_", " ") for code in _CODES)
_CODED = "also, because, by, cause, field, from, limb, of, part, role, rule, through, to, use, what, why"
CODED = frozenset(_CODED.split(", "))  # fields whose values are codes
