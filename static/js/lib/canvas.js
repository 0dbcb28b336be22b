/** A canvas that is painted again, once per frame, when its data, its size or the page's colours change. */

import { coloursOf, onNewColours } from "./colours.js";

export class Canvas {
  #canvas;
  #pen;
  #prefix;
  #names;
  #draw;
  #frame = null;
  #colour = {};
  #observer;
  #listening = new AbortController();

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {string} prefix of the custom properties that hold its colours
   * @param {string[]} names of the colours, without the prefix
   * @param {(pen: CanvasRenderingContext2D, width: number, height: number) => void} draw on the empty canvas,
   *   in device pixels. It is not called while the canvas has no size
   */
  constructor(canvas, prefix, names, draw) {
    this.#canvas = canvas;
    this.#pen = canvas.getContext("2d");
    this.#prefix = prefix;
    this.#names = names;
    this.#draw = draw;
    this.#observer = new ResizeObserver(() => this.#fit());
    this.#observer.observe(canvas);
    const recolour = () => {
      this.#readColours();
      this.redraw();
    };
    onNewColours(recolour, this.#listening.signal);
    this.#readColours();
  }

  get pen() {
    return this.#pen;
  }

  /** @returns {Record<string, string>} the page's colours, by name */
  get colour() {
    return this.#colour;
  }

  /** Device pixels per page pixel, at most 2: more cost time and nobody sees the difference. */
  get density() {
    return Math.min(devicePixelRatio || 1, 2);
  }

  redraw() {
    this.#frame ??= requestAnimationFrame(() => {
      this.#frame = null;
      this.#paint();
    });
  }

  close() {
    this.#listening.abort();
    this.#observer.disconnect();
    cancelAnimationFrame(this.#frame);
  }

  #readColours() {
    const properties = this.#names.map((name) => `${this.#prefix}${name}`);
    const colours = coloursOf(this.#canvas.parentElement, properties);
    this.#colour = Object.fromEntries(this.#names.map((name, i) => [name, colours[i]]));
  }

  #fit() {
    this.#canvas.width = Math.round(this.#canvas.clientWidth * this.density);
    this.#canvas.height = Math.round(this.#canvas.clientHeight * this.density);
    this.redraw();
  }

  #paint() {
    const { width, height } = this.#canvas;
    if (!width || !height) return;
    this.#pen.setTransform(1, 0, 0, 1, 0, 0);
    this.#pen.globalAlpha = 1;
    this.#pen.clearRect(0, 0, width, height);
    this.#draw(this.#pen, width, height);
  }
}
