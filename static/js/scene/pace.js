/** How finely and how often the 3D picture is drawn: with 30 pictures a second, and with time left for the stick. */

const LEAST_MS = 25; // between two pictures: other programs need the processor, too
const LONGEST_MS = 36; // for a picture
const BUSY_MS = 500; // longer than a picture takes: the page was busy with other work
const SHARE = 2 / 3; // of the page's time, at most, in which it draws
const FINER_AGAIN = 8; // good counts in a row, after which the resolution goes up again
const COUNTED = 15; // pictures for each count
const COARSEST = 0.5; // least share of the pixels of a side
const STEP = 0.85;
const MOST_PIXELS = 1.0e6; // of a picture that software draws
const MOST_PIXELS_QUICK = 4.0e6;
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;

/** Return whether this browser draws 3D pictures without a graphics processor. */
export function drawsInSoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return true;
  const facts = context.getExtension("WEBGL_debug_renderer_info");
  const name = context.getParameter(facts ? facts.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(String(name));
}

export class Pace {
  #slow;
  #share = 1;
  #times = [];
  #tookMs = 0;
  #good = 0; // counts in a row

  /** @param {boolean} slow whether software draws the pictures */
  constructor(slow) {
    this.#slow = slow;
  }

  /** Count the time from the last picture to this one. @returns {boolean} whether the ratio has changed */
  addFrameTime(ms) {
    if (ms > BUSY_MS) return false;
    this.#times.push(ms);
    if (this.#times.length < COUNTED) return false;
    const middle = this.#times.sort((a, b) => a - b)[COUNTED >> 1];
    this.#times = [];
    const before = this.#share;
    this.#good = middle > LONGEST_MS ? 0 : this.#good + 1;
    if (this.#good === 0) this.#share = Math.max(before * STEP, COARSEST);
    if (this.#good >= FINER_AGAIN) {
      this.#good = 0;
      this.#share = Math.min(before / STEP, 1);
    }
    return this.#share !== before;
  }

  /** How long the page did nothing but draw the last picture. */
  set tookMs(ms) {
    this.#tookMs = Math.min(ms, BUSY_MS);
  }

  /** The least time from the begin of the last picture to the next one. */
  get leastMs() {
    return Math.max(LEAST_MS, this.#tookMs / SHARE);
  }

  /** Return the drawn pixels per pixel of the page. */
  ratio(width, height, density) {
    const finest = this.#slow ? 1 : Math.min(density, 2);
    const most = this.#slow ? MOST_PIXELS : MOST_PIXELS_QUICK;
    return Math.min(finest * this.#share, Math.sqrt(most / (width * height)));
  }
}
