/** Bars over days, hours or weekdays: how long a robot was driven. */

import { Plot } from "../plots/uplot.js";

const LEAST = 1; // hour or minute: least height of the axis, also if the robot was not driven
const AXIS_PIXELS = 56;
const PIXELS_PER_LABEL = 56;

/** Return the values in hours; in minutes if all are less than an hour. @param {number[]} hours */
export function inUnits(hours) {
  if (Math.max(...hours) >= 1) return { unit: gettext("h"), values: hours };
  return { unit: gettext("min"), values: hours.map((value) => value * 60) };
}

/** @param {HTMLElement} element @param {string[]} labels one for each bar @param {number[]} hours */
export function drawBars(element, labels, hours) {
  const { unit, values } = inUnits(hours);
  const places = labels.map((_, i) => i);

  function look({ axis, colours, paths }) {
    const bars = paths.bars({ size: [0.7, 48], align: 0 });
    const [bar] = colours(["--accent"]);
    const room = Math.max((element.clientWidth - AXIS_PIXELS) / PIXELS_PER_LABEL, 1);
    const every = Math.ceil(labels.length / room);
    const shown = places.filter((i) => i % every === 0);
    return {
      legend: { show: false },
      scales: {
        x: { time: false, range: [-0.5, labels.length - 0.5] },
        y: { range: (_, _low, high) => [0, Math.max(high ?? 0, LEAST) * 1.02] },
      },
      axes: [
        {
          ...axis,
          grid: { show: false },
          splits: () => shown,
          values: () => shown.map((i) => labels[i]),
          size: 28,
        },
        {
          ...axis,
          values: (_, ticks) => ticks.map((tick) => `${tick} ${unit}`),
          size: AXIS_PIXELS,
        },
      ],
      series: [{}, { fill: bar, stroke: bar, width: 0, paths: bars, points: { show: false } }],
    };
  }

  new Plot(element, () => [places, values], look);
}
