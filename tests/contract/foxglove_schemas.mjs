// Prints the JSON Schemas that Foxglove publishes, by title and without their descriptions.
import schemas from "@foxglove/schemas/jsonschema.js";

function bare(value, isProperties = false) {
    if (Array.isArray(value)) {
        return value.map((one) => bare(one));
    }
    if (value === null || typeof value !== "object") {
        return value;
    }
    const kept = Object.entries(value).filter(
        ([name]) => isProperties || !["$comment", "description"].includes(name),
    );
    return Object.fromEntries(kept.map(([name, one]) => [name, bare(one, name === "properties")]));
}

console.log(JSON.stringify(Object.fromEntries(
    Object.values(schemas).filter((one) => one.title).map((one) => [one.title, bare(one)]),
)));
