/** The words of TIAGo's own motions in the page's language. Words that are not in this list are the robot's own. */

const KNOWN = new Set([
  gettext_noop("Home"),
  gettext_noop("Fold the arm within the circle of the base"),
  gettext_noop("Unfold arm"),
  gettext_noop("Bring the arm out of its home position"),
  gettext_noop("Hold object home"),
  gettext_noop("Home, with something in the gripper"),
  gettext_noop("Reach floor"),
  gettext_noop("Reach down to the floor"),
  gettext_noop("Reach max"),
  gettext_noop("Reach as high as the arm goes"),
  gettext_noop("Prepare grasp"),
  gettext_noop("Arm ready before a table, looking at it"),
  gettext_noop("Inspect surroundings"),
  gettext_noop("Look around with the head"),
  gettext_noop("Open hand"),
  gettext_noop("Open the gripper"),
  gettext_noop("Close hand"),
  gettext_noop("Close the gripper"),
  gettext_noop("Close hand half"),
  gettext_noop("Close the gripper half-way"),
  gettext_noop("Point"),
  gettext_noop("Point to the front"),
  gettext_noop("Wave"),
  gettext_noop("Wave the hand"),
  gettext_noop("Pregrasp weight"),
  gettext_noop("Hold the hand out for a weight"),
  gettext_noop("Do weights"),
  gettext_noop("Lift a weight twice"),
  gettext_noop("Offer"),
  gettext_noop("Hold the hand out to a person"),
  gettext_noop("Shake hands"),
  gettext_noop("Shake hands with a person"),
  gettext_noop("Pick from floor"),
  gettext_noop("Reach down and come up again"),
  gettext_noop("Head tour"),
  gettext_noop("Show what the head can do"),
]);

const inPageWords = (text) => (KNOWN.has(text) ? gettext(text) : text);

/** Return the motions that a robot offers, with their words in the page's language. @param {object[]} motions */
export function worded(motions) {
  return motions.map((motion) => ({
    ...motion,
    title: inPageWords(motion.title),
    description: inPageWords(motion.description),
  }));
}
