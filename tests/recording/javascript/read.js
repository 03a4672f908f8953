// Reads a recording by the libraries of another language: MCAP's own, msgpack, JSON Schema.
// Prints one JSON line of every message: [key, schema, encoding, log time, number, values].

import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import { decode } from "@msgpack/msgpack";
import Ajv from "ajv/dist/2020.js";

const readable = new FileHandleReadable(await open(process.argv[2], "r"));
const reader = await McapIndexedReader.Initialize({
  readable,
  decompressHandlers: await loadDecompressHandlers(),
});
const ajv = new Ajv.default({ strict: false });
const fits = new Map();
for (const { id, data } of reader.schemasById.values()) {
  fits.set(id, ajv.compile(JSON.parse(new TextDecoder().decode(data))));
}
for await (const { channelId, logTime, sequence, data } of reader.readMessages()) {
  const { topic, messageEncoding, schemaId } = reader.channelsById.get(channelId);
  const { name, encoding } = reader.schemasById.get(schemaId);
  const values = decode(data, { useBigInt64: true });
  const plain = JSON.parse(JSON.stringify(values, (_, value) => (typeof value === "bigint" ? Number(value) : value)));
  if (!fits.get(schemaId)(plain)) throw new Error(`${topic}: ${ajv.errorsText(fits.get(schemaId).errors)}`);
  console.log(JSON.stringify([topic, name, `${encoding} ${messageEncoding}`, String(logTime), sequence, plain]));
}
