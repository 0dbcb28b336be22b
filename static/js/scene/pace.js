/** How fine the 3D picture is drawn: as fine as the screen, or coarser, so that 30 pictures a second come. */

const LONGEST_MS = 36; // of a picture
const FINER_AGAIN = 8; // good counts in a row, after which it may be finer again
const COUNTED = 15; // pictures that decide together
const COARSEST = 0.5; // share of the pixels of a side
const STEP = 0.85;
const MOST_PIXELS = 1.0e6; // of a picture by software
const MOST_PIXELS_QUICK = 4.0e6;
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;

/** Whether this browser draws 3D pictures without a graphics processor. */
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
  #good = 0; // counts in a row

  /** @param {boolean} slow pictures are drawn by software */
  constructor(slow) {
    this.#slow = slow;
  }

  /** Note how long after the last picture one came. @returns {boolean} the ratio is another one now */
  took(ms) {
    if (ms > 500) return false; // the page did something else
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

  /** Pixels drawn per pixel of the page. */
  ratio(width, height, density) {
    const finest = this.#slow ? 1 : Math.min(density, 2);
    const most = this.#slow ? MOST_PIXELS : MOST_PIXELS_QUICK;
    return Math.min(finest * this.#share, Math.sqrt(most / (width * height)));
  }
}
