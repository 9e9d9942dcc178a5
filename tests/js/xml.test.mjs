// The reader of model descriptions: the same elements as another reader, and text that is no XML.
import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { DOMParser } from "@xmldom/xmldom";

import { parseXml } from "../../widgets/scene3d/xml.js";

const FOLDER = new URL("../../robots/models/", import.meta.url);
const MODELS = readdirSync(FOLDER, { recursive: true }).map(String).filter((name) => name.endsWith(".urdf"));
const ODD = `<?xml version="1.0"?><!-- <robot> is a robot --><robot name='a "b" &amp; &lt;c&gt; &#65;&#x42;'>
  <link name = "x"/><link name="y" a='1'
    b="2 > 1"><![CDATA[<link/>]]>text &amp; more<visual/></link ></robot>`;

/**
 * @param {any} node
 * @returns {import("../../widgets/scene3d/xml.js").Element}
 */
function plain(node) {
  return {
    name: node.nodeName,
    attributes: [...node.attributes].map(({ name, value }) => [name, value]),
    children: [...node.childNodes].filter(({ nodeType }) => nodeType === 1).map(plain),
  };
}

test("shipped models and odd texts have the elements that another reader finds", () => {
  assert.ok(MODELS.length > 0);
  for (const text of [ODD, ...MODELS.map((name) => readFileSync(new URL(name, FOLDER), "utf8"))]) {
    const theirs = new DOMParser().parseFromString(text, "text/xml").documentElement;
    assert.deepEqual(parseXml(text), plain(theirs));
  }
});

test("other texts are refused", () => {
  const bad = [
    "", "robot", "<robot>", "</robot>", "<a></b>", "<a><b></a></b>", "<a/><b/>", "<a x=1/>", "<a x='<'/>", "< a/>", "<a",
    "<!DOCTYPE a [<!ENTITY b 'c'>]><a/>", "<!-- <a/>", `${"<a>".repeat(200)}${"</a>".repeat(200)}`, `<a>${"<b/>".repeat(60_000)}</a>`,
  ];
  for (const text of bad) assert.throws(() => parseXml(text), /the model is (no XML|too large)/, text.slice(0, 40));
});

test("a text without end does not hold up the page", () => {
  const began = performance.now();
  for (const part of ["<!-- ", "<?", "<a ", "<a b='", "<a b='c' ", "&amp;"]) {
    assert.throws(() => parseXml(part.repeat(200_000)));
  }
  assert.ok(performance.now() - began < 2000);
});

test("unknown entities stay as they are", () => {
  assert.deepEqual(parseXml("<a b='&nope; &#x110000; &'/>").attributes, [["b", "&nope; &#x110000; &"]]);
});
