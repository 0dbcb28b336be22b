/** Roles on a robot, each with the rights of those before it. */

const ROLES = ["observer", "operator", "supervisor", "staff"];

/** Why somebody with this role may not do what needs the role `needed`; empty if they may. */
export function whyNot(role, needed) {
  if (ROLES.indexOf(role) >= ROLES.indexOf(needed)) return "";
  return needed === "staff" ? gettext("for staff") : gettext("for supervisors");
}
