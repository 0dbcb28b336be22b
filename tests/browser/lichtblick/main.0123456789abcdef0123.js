/** Stands in for Lichtblick: reads the robot's laser as it would, and tries what it must not do. */

const say = (name, value) => document.body.setAttribute(`data-${name}`, value);
const tries = (name, work) =>
  work().then(
    () => say(name, "reached"),
    () => say(name, "blocked"),
  );

// As Lichtblick does
const socket = new WebSocket(new URLSearchParams(location.search).get("ds.url"), [
  "foxglove.sdk.v1",
  "foxglove.websocket.v1",
]);
socket.binaryType = "arraybuffer";
socket.onmessage = ({ data }) => {
  if (data instanceof ArrayBuffer) {
    say("message", "came");
    return;
  }
  const channel = JSON.parse(data).channels?.find((one) => one.topic === "/scan_raw");
  if (!channel) return;
  const subscriptions = [{ id: 1, channelId: channel.id }];
  socket.send(JSON.stringify({ op: "subscribe", subscriptions }));
};
socket.onclose = ({ code }) => say("closed", code);
say("evaluated", new Function("return 7")());
const inWorker = new Blob(["fetch(origin + '/api/v1/robots').then(() => postMessage('reached'), () => postMessage('blocked'))"]);
new Worker(URL.createObjectURL(inWorker)).onmessage = ({ data }) => say("worker", data);
localStorage.setItem("layout", "kept");
indexedDB.open("layouts").onsuccess = () => say("kept", localStorage.getItem("layout"));

// Acts that it must not do, with the session of the person who opened it
tries("api", () => fetch("/api/v1/robots"));
tries("elsewhere", () => fetch("https://example.org/"));
tries(
  "control",
  () =>
    new Promise((resolve, reject) => {
      const other = new WebSocket(`${location.origin.replace("http", "ws")}/ws/fleet/`);
      other.onopen = resolve;
      other.onerror = reject;
    }),
);
say("window", window.open("/") === null ? "blocked" : "reached");
const frame = document.createElement("iframe");
frame.src = "/";
document.addEventListener("securitypolicyviolation", ({ effectiveDirective }) => {
  if (effectiveDirective === "frame-src") say("frame", "blocked");
});
document.body.append(frame);
