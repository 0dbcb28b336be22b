/** Short functions for elements of a page. Text is only set by textContent. */

/** Sets text if it differs, so that nothing is announced or laid out twice. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function show(element, shown) {
  if (element.hidden === shown) element.hidden = !shown;
}

/** Sets text; without text the element is hidden. */
export function setTextOrHide(element, text) {
  setText(element, text);
  show(element, text !== "");
}

/**
 * Marks a button as disabled, with the reason as its title. The button can still be focused and pressed: then
 * the page shows the reason.
 * @param {string} [why] the reason; without it the button keeps its own title
 */
export function dim(button, dimmed, why = "") {
  if (dimmed) button.setAttribute("aria-disabled", "true");
  else button.removeAttribute("aria-disabled");
  button.dataset.title ??= button.title;
  const title = (dimmed && why) || button.dataset.title;
  if (button.title !== title) button.title = title;
}

/** Sets or removes a data attribute that the style sheet reads. */
export function mark(element, name, value) {
  if (value === null || value === undefined || value === false) delete element.dataset[name];
  else if (element.dataset[name] !== String(value)) element.dataset[name] = value;
}

/** An element with a class, text and children. */
export function make(tag, { className = "", text = null, data = {}, children = [] } = {}) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text !== null) element.textContent = text;
  Object.assign(element.dataset, data);
  element.append(...children);
  return element;
}

/**
 * A button that sends no form.
 * @param {object} settings as of `make`
 * @param {(event: MouseEvent) => void} press
 */
export function makeButton(settings, press) {
  const button = make("button", settings);
  button.type = "button";
  button.addEventListener("click", press);
  return button;
}

function sameTexts(list, texts) {
  return (
    list.children.length === texts.length &&
    texts.every((text, i) => list.children[i].textContent === text)
  );
}

/** Fills a list with one item for each text, unless the list has these items already. */
export function fill(list, texts) {
  if (!sameTexts(list, texts)) list.replaceChildren(...texts.map((text) => make("li", { text })));
}

/** Every element with `data-part` below a root, by that name. */
export function parts(root) {
  const found = {};
  for (const element of root.querySelectorAll("[data-part]")) found[element.dataset.part] = element;
  return found;
}
