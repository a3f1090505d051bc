// A client of Foxglove's protocol: prints what the server advertises, and the first messages as their own schemas say.
//
//     node foxglove_client.cjs NODE_MODULES ADDRESS SUBPROTOCOL COUNT
const { createRequire } = require("node:module");

const [modules, address, protocol, count] = process.argv.slice(2);
const packages = createRequire(`${modules}/`);
const { FoxgloveClient } = packages("@foxglove/ws-protocol");
const { parse } = packages("@foxglove/rosmsg");
const { MessageReader: Ros1Reader } = packages("@foxglove/rosmsg-serialization");
const { MessageReader: Ros2Reader } = packages("@foxglove/rosmsg2-serialization");

const client = new FoxgloveClient({ ws: new WebSocket(address, [protocol]) });
const channels = new Map();
const messages = [];
const plain = (_, value) => (typeof value === "bigint" ? String(value) : ArrayBuffer.isView(value) ? [...value] : value);

function reader({ schema, schemaEncoding }) {
  const definition = parse(schema, { ros2: schemaEncoding === "ros2msg" });
  return schemaEncoding === "ros2msg" ? new Ros2Reader(definition) : new Ros1Reader(definition);
}

client.on("error", (error) => {
  console.error(error);
  process.exit(1);
});
client.on("advertise", (found) => {
  for (const channel of found) {
    const { topic, encoding, schemaName, schemaEncoding } = channel;
    channels.set(client.subscribe(channel.id), { topic, encoding, schemaName, schemaEncoding, reader: reader(channel) });
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const channel = channels.get(subscriptionId);
  messages.push({ topic: channel.topic, timestamp, content: channel.reader.readMessage(data) });
  if (messages.length < Number(count)) return;
  const topics = [...channels.values()].map(({ reader, ...rest }) => rest);
  process.stdout.write(JSON.stringify({ topics, messages }, plain), () => process.exit(0));
});
