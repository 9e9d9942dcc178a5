// Reads ROS messages with Foxglove's own packages: one JSON object a line in, one a line out.
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { createInterface } from "node:readline";

function plain(value) {
    if (typeof value === "bigint") {
        return { big: value.toString() };
    }
    if (typeof value === "number") {
        return Number.isFinite(value) ? value : null;
    }
    if (value instanceof Uint8Array) {
        return { bytes: Buffer.from(value).toString("base64") };
    }
    if (ArrayBuffer.isView(value) || Array.isArray(value)) {
        return Array.from(value, plain);
    }
    if (value !== null && typeof value === "object") {
        return Object.fromEntries(Object.entries(value).map(([name, one]) => [name, plain(one)]));
    }
    return value;
}

for await (const line of createInterface({ input: process.stdin })) {
    const { definition, data } = JSON.parse(line);
    const reader = new MessageReader(parse(definition, { ros2: true }));
    console.log(JSON.stringify(plain(reader.readMessage(Buffer.from(data, "base64")))));
}
