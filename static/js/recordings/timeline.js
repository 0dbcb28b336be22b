/** The replay's one timeline: the slider, the events on it, and what the person does not see of it. */

import { spanText } from "../formats/spans.js";
import { clockText } from "../formats/times.js";
import { make, makeButton, setText, show } from "../lib/dom.js";

/** Return the times of a recording that lie in no part. Pure. */
export function gaps(parts, lastsS) {
  const ends = [0, ...parts.flat(), lastsS];
  return Array.from({ length: ends.length / 2 }, (_, i) => [ends[2 * i], ends[2 * i + 1]]).filter(
    ([from, to]) => to > from,
  );
}

export class Timeline {
  #parts;
  #player;
  #data;
  #buttons = [];
  #present = null; // the button of the last event until now

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {import("./player.js").Player} player
   * @param {{lastsS: number, beganAt: string, events: object[], sees: Array<[number, number]>}} data
   */
  constructor(parts, player, data) {
    this.#parts = parts;
    this.#player = player;
    this.#data = data;
    parts.moment.max = String(data.lastsS);
    parts.moment.addEventListener("input", () => {
      player.atS = Number(parts.moment.value);
    });
    this.#markGaps();
    this.#markEvents();
    player.addEventListener("moment", () => this.#show());
    this.#show();
  }

  #markGaps() {
    for (const [from, to] of gaps(this.#data.sees, this.#data.lastsS)) {
      const gap = make("span", { className: "gap" });
      gap.style.insetInlineStart = this.#share(from);
      gap.style.inlineSize = this.#share(to - from);
      this.#parts.marks.append(gap);
    }
  }

  #markEvents() {
    const { events, "no-events": none, marks } = this.#parts;
    for (const { atS, event, what, text, by, isLogged } of this.#data.events) {
      const mark = make("span", { className: isLogged ? "record" : "event", data: { event } });
      mark.style.insetInlineStart = this.#share(atS);
      marks.append(mark);
      const words = [text, by && !text.includes(by) ? by : ""].filter(Boolean).join(" · ");
      const children = [
        make("span", { className: "numbers", text: this.#clock(atS) }),
        make("strong", { className: "first-upper", text: what }),
        make("span", { className: "quiet", text: words }),
      ];
      const data = isLogged ? {} : { event };
      const button = makeButton({ data, children }, () => {
        this.#player.atS = atS;
      });
      this.#buttons.push([atS, button]);
      events.append(make("li", { children: [button] }));
    }
    show(none, this.#data.events.length === 0);
  }

  #show() {
    const { atS } = this.#player;
    const { moment, time } = this.#parts;
    moment.value = String(atS);
    setText(time, `${spanText(atS, true)} / ${spanText(this.#data.lastsS, true)}`);
    moment.setAttribute("aria-valuetext", this.#clock(atS));
    const present = this.#buttons.findLast(([eventS]) => eventS <= atS + 0.05)?.[1];
    if (present === this.#present) return;
    this.#present?.removeAttribute("aria-current");
    this.#present = present;
    present?.setAttribute("aria-current", "true");
    if (present) this.#scrollTo(present);
  }

  /** Scroll the list, and not the page. */
  #scrollTo(button) {
    const { events } = this.#parts;
    const [list, line] = [events.getBoundingClientRect(), button.getBoundingClientRect()];
    if (line.top < list.top) events.scrollTop -= list.top - line.top;
    else if (line.bottom > list.bottom) events.scrollTop += line.bottom - list.bottom;
  }

  #clock(atS) {
    return clockText(new Date(Date.parse(this.#data.beganAt) + atS * 1000));
  }

  #share(seconds) {
    return `${(100 * seconds) / Math.max(this.#data.lastsS, 0.001)}%`;
  }
}
