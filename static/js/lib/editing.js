/** Return whether an element uses the keys itself: a field, a list, an open dialog. */
export function isEditing(target) {
  return Boolean(
    target?.closest?.(
      "input, textarea, select, dialog[open], [contenteditable]:not([contenteditable='false'])",
    ),
  );
}
