/** Roles on a robot, each with the rights of those before it. */

const ROLES = ["observer", "operator", "supervisor", "staff"];

/** Return whether somebody with this role may do what needs the role `needed`. */
export function isAtLeast(role, needed) {
  return ROLES.indexOf(role) >= ROLES.indexOf(needed);
}

/** Why somebody with this role may not do what needs the role `needed`; empty if they may. */
export function whyNot(role, needed) {
  if (isAtLeast(role, needed)) return "";
  const texts = {
    operator: gettext("for operators"),
    supervisor: gettext("for supervisors"),
    staff: gettext("for staff"),
  };
  return texts[needed];
}
