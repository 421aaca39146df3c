// Read a whole file with @mcap/core, every checksum it knows verified, and print what it holds.
//
//   node verify.mjs FILE.mcap
//
// Front to back for chunks and attachments, then by the index for the summary. Of each topic the
// count of messages and a SHA-256 over sequence, log time, publish time and data of each.

import { createHash } from "node:crypto";
import { readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";

class Topic {
  count = 0;
  hash = createHash("sha256");
  add(message) {
    const head = Buffer.alloc(24);
    head.writeUInt32LE(message.sequence, 0);
    head.writeBigUInt64LE(message.logTime, 4);
    head.writeBigUInt64LE(message.publishTime, 12);
    head.writeUInt32LE(message.data.length, 20);
    this.hash.update(head);
    this.hash.update(message.data);
    this.count += 1;
  }
  toJSON() {
    return [this.count, this.hash.digest("hex")];
  }
}

function collect(topics, name, message) {
  topics[name] ??= new Topic();
  topics[name].add(message);
}

const bytes = await readFile(process.argv[2]);
const decompressHandlers = await loadDecompressHandlers();

const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(bytes);
const streamed = {};
const names = new Map();
const attachments = [];
const metadata = [];
for (let record; (record = stream.nextRecord()) !== undefined; ) {
  if (record.type === "Channel") {
    names.set(record.id, record.topic);
  } else if (record.type === "Message") {
    collect(streamed, names.get(record.channelId), record);
  } else if (record.type === "Attachment") {
    attachments.push([record.name, Buffer.from(record.data).toString("hex")]);
  } else if (record.type === "Metadata") {
    metadata.push([record.name, Object.fromEntries(record.metadata)]);
  }
}
if (!stream.done()) {
  throw new Error("the file does not end as it should");
}

const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) =>
    new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const indexed = {};
for await (const message of reader.readMessages({ validateCrcs: true })) {
  collect(indexed, reader.channelsById.get(message.channelId).topic, message);
}
console.log(JSON.stringify({ streamed, indexed, attachments, metadata }));
