/**
 * A ghost of the robot where a person pressed in the plan or on the floor in the camera's picture; buttons drive or
 * look there. The press alone moves nothing.
 */

import { whyNotNow } from "../control/lease.js";
import { isWithin, withArm } from "../drive/twist_geometry.js";
import { dim, mark, setText, show } from "../lib/dom.js";
import { heldOnce, TWO_TAPS_MS } from "../lib/presses.js";
import { endNotice } from "../navigation/words.js";
import { DriveThere } from "./drive_there.js";
import { fromBase, onFloor, wayTo } from "./way.js";
import { problemText, wayText } from "./words.js";

export class GoingPanel {
  static hears = ["facts", "view", "stale", "mayAct", "tab", "pointed", "state.drive_by"];
  #parts;
  #tell;
  #notify;
  #drive;
  #facts = null;
  #view = null;
  #goal = null; // the point in the frame of the odometry
  #shape = null; // of the way that is driven, in that frame: it does not turn with the robot
  #lookAt = null; // turns the head to a point
  #from = null; // the picture in which keys pointed: it gets the focus back from the offer
  #pointedMs = 0;
  #mayAct = null;
  #isStale = false;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, request, notify, tell }) {
    this.#parts = parts;
    this.#tell = tell;
    this.#notify = notify;
    this.#drive = new DriveThere(request, (ended) => this.#over(ended));
    const { signal } = this.#listening;
    const on = (part, act) => parts[part].addEventListener("click", act, { signal });
    on("there-go", () => this.#go());
    on("there-look", () => this.#look());
    on("there-close", () => this.#forget());
    // The key that chose the point may still be held.
    parts["there-offer"].addEventListener("keydown", heldOnce, { signal });
    const ends = (event) => event.key === "Escape" && this.#goal && this.#forget();
    document.addEventListener("keydown", ends, { signal });
  }

  set facts(facts) {
    this.#facts = facts;
  }

  /** @param {{state: object, scan: ?object}} view of the robot */
  set view(view) {
    this.#view = view;
    if (this.#goal) this.#show();
  }

  /** @param {{now: ?object, ended: ?object}} drive by a distance or angle */
  set drive_by(drive) {
    this.#drive.drive = drive;
  }

  /** @param {boolean} stale nobody knows what is where now */
  set stale(stale) {
    this.#isStale = stale;
    if (stale && this.#drive.runs) this.#forget(); // a ghost that only stands there waits
  }

  /** @param {?boolean} may whether this tab has control */
  set mayAct(may) {
    this.#mayAct = may;
    if (this.#goal) this.#show();
  }

  /**
   * @param {?{point: number[], look: ?function, from: ?HTMLElement}} pointed a press, or by keys in the picture `from`:
   *   a point in the base frame; null: nothing any more. While the robot drives there, a press ends nothing: people also look around by presses
   */
  set pointed(pointed) {
    if (this.#drive.runs) return;
    const isAgain = pointed && this.#ghost && isWithin(this.#ghost.ghost, pointed.point);
    this.#forget();
    if (!pointed || isAgain || this.#isStale || !this.#base) return;
    this.#goal = onFloor(pointed.point, this.#base);
    this.#lookAt = pointed.look ?? null;
    this.#from = pointed.from ?? null;
    this.#pointedMs = performance.now();
    this.#show();
    if (this.#from) this.#parts["there-go"].focus();
  }

  /** Another tab does not show the ghost. */
  set tab(_tab) {
    this.#forget();
  }

  /** A stop, or the person left: nothing more is asked of the robot. */
  zero() {
    this.#drive.drop();
    this.#forget();
  }

  close() {
    this.#drive.drop();
    this.#listening.abort();
  }

  get #base() {
    return this.#view?.state.odometry ?? null;
  }

  /** The point in the base frame. */
  get #point() {
    return fromBase(this.#goal, this.#base);
  }

  get #outline() {
    return withArm(this.#facts.footprint, this.#view.state.arm ?? []);
  }

  get #way() {
    const { laser_cm = [], remembered_cm = [], depth_cm = [] } = this.#view.scan ?? {};
    const known = [...laser_cm, ...remembered_cm, ...depth_cm];
    return wayTo(this.#point, this.#outline, known, this.#facts);
  }

  /** The shape that pictures draw, in the base frame; null: no ghost. */
  get #ghost() {
    if (!this.#goal || !this.#base) return null;
    if (!this.#shape) return this.#way;
    const here = (points) => points.map((point) => fromBase(point, this.#base));
    const { ghost, floor, nose } = this.#shape;
    return { ghost: here(ghost), floor: here(floor), nose: here([nose])[0], problem: "" };
  }

  #show() {
    // A robot that was driven there by the stick has no way any more.
    const isThere = this.#goal && this.#base && isWithin(this.#outline, this.#point);
    if (isThere && !this.#drive.runs) this.#goal = null;
    const ghost = this.#ghost;
    this.#tell({ ghost });
    const {
      "there-offer": offer,
      "there-words": words,
      "there-go": go,
      "there-look": look,
    } = this.#parts;
    const isOffered = ghost !== null && !this.#drive.runs;
    const hadFocus = offer.contains(document.activeElement);
    show(offer, isOffered);
    if (!isOffered) {
      if (hadFocus) this.#from?.focus();
      return;
    }
    mark(offer, "problem", ghost.problem || null);
    setText(words, wayText(ghost));
    const why = this.#whyNot(ghost);
    dim(go, why !== "", why);
    show(look, this.#lookAt !== null);
    dim(look, !this.#mayAct, whyNotNow());
  }

  /** Why *Drive there* does nothing now; empty: it drives. */
  #whyNot(way) {
    return this.#mayAct ? problemText(way) : whyNotNow();
  }

  #go() {
    if (performance.now() - this.#pointedMs < TWO_TAPS_MS) return;
    const way = this.#way;
    const why = this.#whyNot(way);
    if (why) return this.#say(why);
    const { ghost, floor, nose } = way;
    const stay = (points) => points.map((point) => onFloor(point, this.#base));
    this.#shape = { ghost: stay(ghost), floor: stay(floor), nose: stay([nose])[0] };
    this.#drive.begin(() => this.#way);
    this.#show();
  }

  #look() {
    if (performance.now() - this.#pointedMs < TWO_TAPS_MS) return;
    if (!this.#mayAct) return this.#say(whyNotNow());
    this.#lookAt(this.#point);
  }

  #say(text) {
    this.#notify({ level: "info", code: "going", text });
  }

  /** @param {?object} ended as `DriveThere` tells it; a refused request and a bad end have their own notices */
  #over(ended) {
    const notice = ended && endNotice(ended);
    const blocked = ended ? "" : problemText(this.#way);
    if (notice && !notice.stays) this.#notify(notice);
    else if (blocked) this.#notify({ level: "warning", code: "going blocked", text: blocked });
    this.#forget();
  }

  #forget() {
    this.#drive.cancel();
    if (!this.#goal) return;
    this.#goal = this.#shape = this.#lookAt = null;
    this.#show();
  }
}
