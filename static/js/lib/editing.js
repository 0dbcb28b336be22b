const SLID_OR_TICKED = new Set(["range", "checkbox", "radio", "button"]);

/** Return whether an element uses the keys itself: a field, a list, an open dialog. */
export function isEditing(target) {
  return Boolean(
    target?.closest?.(
      "input, textarea, select, dialog[open], [contenteditable]:not([contenteditable='false'])",
    ),
  );
}

/** Return whether the element needs both hands or the keyboard: a finger alone slides and ticks. */
export function takesText(target) {
  return isEditing(target) && !SLID_OR_TICKED.has(target.type);
}
