/** The picture area of the control page, with the elements of its template. */

const PARTS = `
<main data-camera="/ws/robots/tiago-1/camera/">
  <div data-part="picture-area" data-view="plan">
    <section><canvas data-part="picture"></canvas></section>
    <section data-part="scene" hidden></section>
    <section data-part="map" hidden></section>
    <section data-part="plot" hidden></section>
    <section data-part="camera" hidden>
      <canvas class="camera-picture"></canvas><canvas data-part="camera-floor"></canvas>
      <p class="camera-age"></p><p class="camera-words"></p>
    </section>
    <section data-part="second" hidden>
      <canvas class="camera-picture"></canvas>
      <p class="camera-age"></p><p class="camera-words"></p>
      <button data-part="second-swap"></button>
      <button data-part="plan-swap"></button>
    </section>
    <button data-part="view-open" aria-expanded="false" hidden></button>
    <div data-part="view-bar" hidden>
      <div data-part="views">
        <button data-view="plan"></button><button data-view="camera"></button><button data-view="both"></button><button data-view="scene"></button><button data-view="own" hidden></button>
      </div>
      <label data-part="camera-pick" hidden><select data-part="camera-select"></select></label>
      <button data-part="second-toggle" aria-pressed="false" hidden></button>
      <div data-part="head-keys" hidden><button data-turn="left"></button></div>
      <button data-part="snapshot" hidden></button>
      <button data-part="full-screen" hidden></button>
    </div>
  </div>
</main>`;

const pen = new Proxy({}, { get: () => () => {}, set: () => true });

function withPens(root) {
  for (const canvas of root.querySelectorAll("canvas")) canvas.getContext = () => pen;
  return root;
}

/** Make the whole area in the document. */
export function areaElement(width = 800, height = 600) {
  document.body.innerHTML = PARTS;
  const root = withPens(document.querySelector("main"));
  const area = root.querySelector("[data-part=picture-area]");
  Object.defineProperty(area, "clientWidth", { value: width, configurable: true });
  Object.defineProperty(area, "clientHeight", { value: height, configurable: true });
  return root;
}

/** Make the area; return the element of one camera. */
export function cameraElement() {
  return areaElement().querySelector("[data-part=camera]");
}
