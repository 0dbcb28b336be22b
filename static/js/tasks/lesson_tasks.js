/** The tasks that a lesson leaves to its members: the page offers nothing else, and the console refuses the rest. */

/**
 * Return those of `items` that the lesson leaves.
 * @template T
 * @param {?object} tasks of the lesson; null: it leaves everything
 * @param {"motions" | "phrases" | "places"} list
 * @param {T[]} items @param {(item: T) => string} nameOf
 */
export function leftOf(tasks, list, items, nameOf) {
  if (!limits(tasks, list)) return items;
  const left = new Set(tasks.without?.includes(list) ? [] : tasks[list]);
  return items.filter((item) => left.has(nameOf(item)));
}

/** Return whether the lesson leaves only some of a list, or nothing. */
export function limits(tasks, list) {
  return Boolean(tasks?.without?.includes(list) || tasks?.[list]?.length);
}
