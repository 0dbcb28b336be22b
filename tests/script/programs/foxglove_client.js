/**
 * A program on Foxglove's own libraries, unchanged: reads topics and decodes them by the definitions that it was sent.
 *
 *     node foxglove_client.js ADDRESS TOKEN TOPIC…     an empty token: the address has a ticket
 *
 * Prints one JSON line for each thing that it learned, and ends when it has a message of each topic. The graph is there
 * when it has the publishers of all of them: the console may still be learning who publishes.
 */

import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg-serialization";
import { FoxgloveClient } from "@foxglove/ws-protocol";

const [address, token, ...topics] = process.argv.slice(2);
const headers = token ? { Authorization: `Bearer ${token}` } : {};
const protocols = ["foxglove.sdk.v1", FoxgloveClient.SUPPORTED_SUBPROTOCOL];
const socket = new WebSocket(address, { protocols, headers });
const client = new FoxgloveClient({ ws: socket });
const readers = new Map();
const missing = new Set(topics);
const published = {};

const say = (fact) => console.log(JSON.stringify(fact));

/** Arrays of numbers as their length and first values. */
function short(value) {
  if (ArrayBuffer.isView(value)) return { length: value.length, first: [...value.slice(0, 4)] };
  if (Array.isArray(value)) return value.slice(0, 3).map(short);
  if (typeof value === "bigint") return Number(value);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([name, inner]) => [name, short(inner)]));
}

function endWhenComplete() {
  if (missing.size > 0) return;
  client.close();
}

client.on("open", () => say({ protocol: socket.protocol }));
client.on("serverInfo", ({ name, capabilities }) => say({ name, capabilities }));
client.on("advertise", (channels) => {
  for (const { id, topic, schema, schemaName } of channels) {
    if (!missing.has(topic)) continue;
    const reader = new MessageReader(parse(schema));
    readers.set(client.subscribe(id), { topic, schemaName, reader });
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, schemaName, reader } = readers.get(subscriptionId);
  if (!missing.delete(topic)) return;
  const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  say({ topic, type: schemaName, stamp: Number(timestamp) / 1e9, message: short(reader.readMessage(bytes)) });
  client.unsubscribe(subscriptionId);
  endWhenComplete();
});
client.on("parameterValues", ({ id, parameters }) => {
  say({ id, parameters: parameters.length });
  missing.delete("parameters");
  endWhenComplete();
});
client.on("connectionGraphUpdate", ({ publishedTopics }) => {
  for (const { name, publisherIds } of publishedTopics) published[name] = publisherIds; // only what changed
  if (topics.some((topic) => topic.startsWith("/") && !published[topic])) return;
  say({ published });
  missing.delete("graph");
  endWhenComplete();
});
client.on("status", ({ level, message }) => {
  say({ level, status: message });
  missing.delete("status");
  endWhenComplete();
});
client.on("error", (error) => say({ error: String(error.message ?? error) }));
client.on("close", ({ code, reason }) => {
  say({ code, reason });
  process.exit(0);
});
client.on("open", () => {
  if (missing.has("parameters")) client.getParameters([], "all");
  if (missing.has("graph")) client.subscribeConnectionGraph();
  if (missing.has("status")) {
    const id = client.advertise({ topic: "/cmd_vel", encoding: "ros1", schemaName: "geometry_msgs/Twist" });
    client.sendMessage(id, new Uint8Array(48));
  }
});
