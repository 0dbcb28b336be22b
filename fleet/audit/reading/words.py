"""Words of records that people read in their language: names of fields, and codes of outcomes and refusals.

Each is a key of the catalogue of sentences, with blanks in place of underscores. Other words stay as they are.
"""

from __future__ import annotations

_NAMES = """
accepted, account_inactive, added, address, allowed, already_yours, angle, archived, arm_away, arrived,
asked, awaiting, away, base_moving, before, behind_unseen, blind_direction, book_first, booked, booking,
bridge, bridge_down, bridge_ended, bridge_lost, bridge_silent, bridge_unreachable, browser, busy, by,
camera, camera_ended, camera_hung, camera_silent, camera_starts, cancelled, cause, changed, changes, clear,
closed, code, confirmed, connection_lost, control_ended, course, course_over, days, dead_man, dead-man,
depth_stale, distance, done, drive, driving, duration, email, empty_text, enabled, ends, ends_at,
expires_at, failed, finished, flood, free, from, full_name, given_up, goal_outside, goes_on, going, granted,
group, groups, halted, handed_over, head_away, heading, held, holder_name, inspector_silent, invalid,
invitation_expired, invitation_revoked, invitation_used, is_active, is_staff, is_superuser, kinds, language,
latched, latency, lease_over, limb, limb_busy, limb_moving, limb_unknown, limit, link_fault, link_lost,
localisation_old, map, master_uri, method, motion_blocked, motion_running, moved, name, navigation_busy,
near_miss, neutral_needed, next_in_line, no_answer, no_camera, no_drive, no_goal, no_head, no_lease,
no_limb, no_map, no_motion, no_move, no_navigation, no_progress, no_role, no_show, no_speech, not_allowed,
not_cleared, not_found, not_holder, not_in_control, not_recorded, not_there, not_watched, note, number,
obstacle, odometry_anew, odometry_missing, odometry_stale, of, offer_over, offered, old_fence, other_robot,
out_of_range, out_of_service, over, overtaken, page, password, pending, people, person, person_name, place,
place_unknown, points, practice, profile, program, project, purpose, qualification, reason, refused,
rejected, released, removed, replaced, right, robot_disabled, robot_offline, robot_page, robot_silent, role,
role_lowered, role_too_low, rule, scan_missing, scan_stale, scan_unpaired, scope_missing, scopes, sent,
signed_out, slot, sonar_stale, speaking, speed, stalled, standstill, starts, starts_at, stopped,
stopped_again, stopping, succeeded, superseded, tags, taken, taken_over, term, text, text_too_long, texts,
through, time_zone, times, to, too_close, too_deep, too_far, too_fast, too_large, too_late, too_many,
too_old, top, type, unheard, unknown, unqualified, until, use, username, was_standing, what, why,
wrong_course,
account, arm, audit, base, call, choose, database, error, gate, gripper, head, lease, limits, motions,
observer, ok, operator, publish, rest, robot, set, silent, speech, staff, stop, supervisor, torso, warning,
wire, actor, address_digest, also, at, bearing, because, connection, digest, entry, expires, factor, field,
fields, figures, format, holder, host, interventions, invitation, left, lesson, list, made_with,
map_to_odom, most_uses, motion, name_digest, nearest, override, part, parts, path, period, pose, publishers,
records, request, robots, rows, sensor, service, side, since, stays, supervisors, tab, token, topic, user,
value, webhook, words,
around_the_gate, backwards, bad_definition, bad_description, bad_field, bad_picture, bridge_fault,
bridge_unresolvable, broken, control_characters, definition_differs, duplicate_field, fence_taken,
goal_in_obstacle, held_away, hello_first, hello_twice, if_match_missing, in_past, in_progress,
inspector_fault, key_reused, localisation_missing, localisation_uncertain, map_changed, map_unknown,
may_not_clear, method_not_allowed, more_than_own, name_alike, name_mixed, name_reserved, name_taken,
name_unseen, navigation_goes_on, no_account, no_colleague, no_invitation, no_listener, no_message,
no_outline, no_parameter, no_programs, no_publisher, no_reason, no_service, no_such_request, no_such_robot,
not_connected, not_for_others, not_json, not_offered, not_publishing, not_text, not_utf8, not_yours,
other_link, other_process, other_robots, out_of_order, outcome_unknown, password_needed, permission_denied,
protocol, publishers_differ, recording, robot_misdescribed, robot_needed, role_of_control, service_failed,
service_lost, service_silent, somebody_asks, state_not_saved, time_gap, too_long, too_many_keys,
too_many_subscriptions, too_much, too_often, type_unknown, unknown_motion, waits_enough, watchdog_missing,
wrong_type, wrong_year, zero_length
"""
WORDS = frozenset(name.strip().replace("_", " ") for name in _NAMES.split(","))
_CODED = "also, because, by, cause, from, limb, of, part, role, rule, through, to, use, what, why"
CODED = frozenset(_CODED.split(", "))  # fields whose values are codes
