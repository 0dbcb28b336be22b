/** uPlot, which pages load when the first plot has room: it takes long to start. See `load.js`. */

export { default } from "../../vendor/uplot/uPlot.esm.js";
