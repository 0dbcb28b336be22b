/** Loads uPlot from the address in the page's data-plots-module. */

export async function loadUPlot() {
  const { plotsModule } = document.querySelector("[data-plots-module]").dataset;
  return (await import(plotsModule)).default;
}
