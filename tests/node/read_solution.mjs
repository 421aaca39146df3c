// Decode messages of a topic with the libraries Foxglove uses and print them as JSON.
//
//   node read_solution.mjs FILE.mcap TOPIC COUNT
//
// The first and last COUNT messages are printed. Every float64 stands as its 64 bits in
// hexadecimal, so that the reader of the JSON compares bits and not decimal text.

import { open } from "node:fs/promises";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";

const [path, topic, count] = process.argv.slice(2);

class Readable {
  constructor(handle) {
    this.handle = handle;
  }
  async size() {
    return BigInt((await this.handle.stat()).size);
  }
  async read(offset, length) {
    const buffer = new Uint8Array(Number(length));
    const { bytesRead } = await this.handle.read(buffer, 0, buffer.length, Number(offset));
    if (bytesRead !== buffer.length) {
      throw new Error(`${bytesRead} of ${buffer.length} bytes at ${offset}`);
    }
    return buffer;
  }
}

function bits(value) {
  const view = new DataView(new ArrayBuffer(8));
  view.setFloat64(0, value);
  return view.getBigUint64(0).toString(16).padStart(16, "0");
}

// Floats as bits, integers as they are: the message definition says which is which.
function encode(value, definitions, definition) {
  const out = {};
  for (const field of definition.definitions) {
    if (field.isConstant) {
      continue;
    }
    const item = value[field.name];
    if (field.isComplex) {
      const inner = definitions.find((candidate) => candidate.name === field.type);
      out[field.name] = encode(item, definitions, inner);
    } else if (field.type === "float64") {
      out[field.name] = field.isArray ? Array.from(item, bits) : bits(item);
    } else if (field.type === "time") {
      out[field.name] = { sec: item.sec, nanosec: item.nanosec ?? item.nsec };
    } else {
      out[field.name] = item;
    }
  }
  return out;
}

const handle = await open(path, "r");
try {
  const reader = await McapIndexedReader.Initialize({
    readable: new Readable(handle),
    decompressHandlers: await loadDecompressHandlers(),
  });
  const channel = [...reader.channelsById.values()].find((one) => one.topic === topic);
  const schema = reader.schemasById.get(channel.schemaId);
  const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
  const decoder = new MessageReader(definitions);
  const root = definitions.find((one) => one.name === undefined) ?? definitions[0];

  const rows = [];
  for await (const message of reader.readMessages({ topics: [topic] })) {
    rows.push(message.data);
  }
  const shown = [...rows.slice(0, Number(count)), ...rows.slice(-Number(count))];
  const messages = shown.map((data) => encode(decoder.readMessage(data), definitions, root));
  console.log(
    JSON.stringify({ schema: schema.name, encoding: schema.encoding, total: rows.length, messages }),
  );
} finally {
  await handle.close();
}
