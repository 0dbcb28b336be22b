/** The form of downloads: a cut by the moment of the replay; fields without a value are left out of the address. */

/** @param {Record<string, HTMLElement>} parts @param {import("./player.js").Player} player */
export function downloads(parts, player) {
  const form = parts.download;
  const { from, to } = form.elements;
  const cut = (field) => () => {
    field.value = player.atS.toFixed(1);
  };
  parts["cut-from"].addEventListener("click", cut(from));
  parts["cut-to"].addEventListener("click", cut(to));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const topics = [...parts.topics.selectedOptions].map(({ value }) => value);
    location.assign(
      addressOf(form.action, {
        format: form.elements.format.value,
        from: from.value,
        to: to.value,
        topics: topics.join(","),
        pictures: parts["without-pictures"].checked ? "false" : "",
      }),
    );
  });
}

/** Return the address of a file; a field without a value, and the usual format, are left out. Pure. */
export function addressOf(action, fields) {
  const asked = Object.entries(fields).filter(
    ([name, value]) => value && !(name === "format" && value === "mcap"),
  );
  const query = new URLSearchParams(asked).toString();
  return query ? `${action}?${query}` : action;
}
