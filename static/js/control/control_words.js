/** Who has control, and what this person can do about it. Pure: from the server's `control` to words and actions. */

/** How the holder is called on this page. */
function holder(control) {
  return control.holder ?? gettext("Somebody");
}

/**
 * @param {object} control the server's newest `control`
 * @param {number | null} resumableS seconds until a vanished holder loses control
 * @returns {{headline: string, reason: string, actions: string[]}}
 *   actions: take, take_over, renew, release, ask, ask_cancel; the first is the most likely one
 */
export function controlWords(control, resumableS = null) {
  const reason = control.refusal?.text ?? "";
  const force = control.may_take_over ? ["take_over"] : [];
  const question = control.asking === null || control.asking === undefined ? "ask" : "ask_cancel";
  switch (control.state) {
    case "unknown":
      return { headline: gettext("Control is not known"), reason: "", actions: [] };
    case "free":
      return { headline: gettext("Nobody has control"), reason, actions: reason ? [] : ["take"] };
    case "yours":
      return { headline: gettext("You have control"), reason: "", actions: ["renew", "release"] };
    case "elsewhere":
      return {
        headline: gettext("You have control in another tab"),
        reason,
        actions: reason ? [] : ["take"],
      };
    case "away": {
      const gone = gettext("Their page is gone.");
      const wait = gettext("Their page is gone. Free in %s s unless it returns.");
      return {
        headline: interpolate(gettext("%s has control"), [holder(control)]),
        reason: resumableS === null ? gone : interpolate(wait, [Math.ceil(resumableS)]),
        actions: reason ? force : ["take"], // one's own vanished page needs no force
      };
    }
    default:
      return {
        headline: interpolate(gettext("%s has control"), [holder(control)]),
        reason: question === "ask_cancel" ? gettext("You asked for it.") : "",
        actions: [question, ...force],
      };
  }
}
