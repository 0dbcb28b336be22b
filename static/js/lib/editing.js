const SLID_OR_TICKED = new Set(["range", "checkbox", "radio", "button"]);

const FIELD = "input, textarea, select, [contenteditable]:not([contenteditable='false'])";

/** Return whether an element is a field or a list: it uses all keys itself. */
export function isField(target) {
  return Boolean(target?.closest?.(FIELD));
}

/** Return whether an element keeps the keys from the robot: a field, or anything in an open dialog. */
export function isEditing(target) {
  return isField(target) || Boolean(target?.closest?.("dialog[open]"));
}

/** Return whether the element needs both hands or the keyboard: a finger alone slides and ticks. */
export function takesText(target) {
  return isEditing(target) && !SLID_OR_TICKED.has(target.type);
}
