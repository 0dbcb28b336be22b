/** The parts of a robot's state that all tests of the control page need. */

export const STATE = {
  verdict: {},
  latency_s: 0.1,
  latency_measured: true,
  watchers: [],
  watchers_more: 0,
  sensors: [],
  foreign: [],
  refused: {},
  clock_skew_s: null,
};
