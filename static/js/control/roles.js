/** Roles on a robot, each with the rights of those before it. */

const ROLES = ["observer", "operator", "supervisor", "staff"];

/** Return whether a role has the rights of the role `needed`. */
export function isAtLeast(role, needed) {
  return ROLES.indexOf(role) >= ROLES.indexOf(needed);
}

/** Return the reason why a role has not the rights of the role `needed`; empty if it has. */
export function whyNot(role, needed) {
  if (isAtLeast(role, needed)) return "";
  const texts = {
    operator: gettext("for operators"),
    supervisor: gettext("for supervisors"),
    staff: gettext("for staff"),
  };
  return texts[needed];
}
