/** Loads uPlot from the address in the page's data-plots-module. */

export function loadUPlot() {
  const { plotsModule } = document.querySelector("[data-plots-module]").dataset;
  return import(plotsModule).then((library) => library.default);
}
