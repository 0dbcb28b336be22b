/** Notices that the robot forgot what it saw before. */

/** Return the text of an event. Pure. @param {{code: string, text: string}} event as in `state.forgotten` */
export function forgottenText({ code, text }) {
  const texts = {
    asked: gettext("The robot forgot what it saw before: a person asked for it."),
    odometry_restarted: gettext(
      "The robot forgot what it saw before: its wheel sensors or its ROS master were restarted.",
    ),
    stamps_back: gettext("The robot forgot what it saw before: its clock was set back."),
    jump: gettext("The robot forgot what it saw before: its wheel sensors report another place."),
    bridge_started: gettext("The robot forgot what it saw before: its bridge was started."),
  };
  const words = texts[code] ?? text;
  return code === "asked" ? words : `${words} ${gettext("Look around before you drive.")}`;
}

const SAME_MS = 1000; // times of one event differ by less: they are rounded, and views come late

/** Follows a robot's state: notices each event once, and none from before the page was opened. */
export class ForgottenNotices {
  static hears = ["state.forgotten"];
  #notify;
  #last = null;

  /** @param {import("../panels/page_panels.js").Page} page */
  constructor({ notify }) {
    this.#notify = notify;
  }

  /** @param {?object} event of the robot's newest state */
  set forgotten(event) {
    const { number = 0, code = "", ago_s: agoS = Infinity } = event ?? {};
    const before = this.#last;
    const atMs = performance.now() - agoS * 1000;
    this.#last = { number, code, atMs };
    if (!before || !event) return;
    const isSame = number === before.number && code === before.code;
    if (isSame && atMs < before.atMs + SAME_MS) {
      this.#last.atMs = before.atMs;
      return;
    }
    this.#notify({
      level: code === "asked" ? "info" : "warning",
      code: `forgotten ${code}`,
      text: forgottenText(event),
    });
  }
}
