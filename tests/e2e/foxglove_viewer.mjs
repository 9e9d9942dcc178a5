// Foxglove's own client as a program: prints each event as a line of JSON, and reads requests from
// lines of JSON. Arguments: the address and the subprotocols.
import protocol from "@foxglove/ws-protocol";
import { createInterface } from "node:readline";
import WebSocket from "ws";

const { FoxgloveClient } = protocol;
const [address, ...subprotocols] = process.argv.slice(2);
const decoder = new TextDecoder();

function say(event, more) {
    console.log(JSON.stringify({ event, ...more }));
}

const socket = new WebSocket(address, subprotocols);
const client = new FoxgloveClient({ ws: socket });
client.on("open", () => say("open", { protocol: socket.protocol }));
client.on("error", (error) => say("error", { message: String(error.message ?? error) }));
client.on("close", (event) => {
    say("close", { code: event.code, reason: event.reason });
    process.exit(0);
});
client.on("serverInfo", (info) => say("serverInfo", info));
client.on("status", (status) => say("status", status));
client.on("removeStatus", (removed) => say("removeStatus", removed));
client.on("advertise", (channels) => say("advertise", { channels }));
client.on("unadvertise", (channels) => say("unadvertise", { channels }));
client.on("advertiseServices", (services) => say("advertiseServices", { services }));
client.on("unadvertiseServices", (services) => say("unadvertiseServices", { services }));
client.on("message", ({ subscriptionId, timestamp, data }) => {
    const value = JSON.parse(decoder.decode(data));
    say("message", { subscription: subscriptionId, ns: String(timestamp), value });
});
client.on("serviceCallResponse", ({ serviceId, callId, encoding, data }) => {
    say("response", { service: serviceId, call: callId, encoding, value: JSON.parse(decoder.decode(data)) });
});
client.on("serviceCallFailure", (failure) => say("failure", failure));

for await (const line of createInterface({ input: process.stdin })) {
    const asked = JSON.parse(line);
    if (asked.do === "subscribe") {
        say("subscribed", { channel: asked.channel, subscription: client.subscribe(asked.channel) });
    } else if (asked.do === "unsubscribe") {
        client.unsubscribe(asked.subscription);
    } else if (asked.do === "call") {
        const data = new TextEncoder().encode(JSON.stringify(asked.request));
        client.sendServiceCallRequest({
            serviceId: asked.service,
            callId: asked.call,
            encoding: "json",
            data: new DataView(data.buffer),
        });
    } else if (asked.do === "advertise") {
        client.advertise({ topic: "/cmd", encoding: "json", schemaName: "Twist" });
    } else if (asked.do === "close") {
        client.close();
    }
}
