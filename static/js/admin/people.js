/**
 * The person filter of the log: suggests names. Without this script, people type a name or a part of a name.
 */

const WAIT_MS = 200;

/** @param {HTMLInputElement} input with `data-people`, the address that returns names */
export function suggestPeople(input) {
  const list = document.createElement("datalist");
  list.id = `${input.id}-people`;
  input.after(list);
  input.setAttribute("list", list.id);
  let timer = 0;
  let asked = "";
  input.addEventListener("input", () => {
    clearTimeout(timer);
    timer = setTimeout(async () => {
      const typed = input.value.trim();
      if (typed === asked) return;
      asked = typed;
      const answer = await fetch(`${input.dataset.people}?${new URLSearchParams({ q: typed })}`);
      if (!answer.ok || asked !== typed) return;
      const { people } = await answer.json();
      list.replaceChildren(...people.map((name) => new Option(name, name)));
    }, WAIT_MS);
  });
}
