// @ts-check
/**
 * The robot's model: from its URDF, or a box with a nose. Files are only from the profile. A mesh
 * without a file is omitted and reported.
 *
 * @typedef {typeof import("three")} Three
 * @typedef {import("three").Object3D} Object3D
 * @typedef {{object: Object3D, joints: string[], set: (name: string, value: number) => void, missing: string[]}} Model
 */

import { documentOf } from "./xml.js";

/** Colour of parts without a material: visible in every theme. */
const BARE = 0x7a858f;
/** Time limit for loading a file. */
const WAIT_MS = 20_000;

/**
 * @param {Three} three
 * @param {readonly number[]} size length, width, height
 * @returns {Model}
 */
export function box(three, [length = 0.6, width = 0.4, height = 0.2]) {
  const object = new three.Group();
  const body = new three.Mesh(
    new three.BoxGeometry(length, width, height),
    new three.MeshLambertMaterial({ color: BARE }),
  );
  // A nose and a mark on the top show the direction from all sides.
  const nose = new three.Mesh(
    new three.ConeGeometry(width * 0.3, length * 0.35, 12).rotateZ(-Math.PI / 2),
    new three.MeshLambertMaterial({ color: 0xf0b23e }),
  );
  nose.position.x = length * 0.6;
  const mark = new three.Mesh(
    new three.BoxGeometry(length * 0.4, width * 0.1, height * 0.1),
    new three.MeshLambertMaterial({ color: 0xf0b23e }),
  );
  mark.position.set(length * 0.2, 0, height * 0.52);
  object.add(body, nose, mark);
  return { object, joints: [], set: () => {}, missing: [] };
}

/**
 * @param {Three} three
 * @param {{url: string} | {text: string}} source URL of the URDF file, or its text
 * @param {readonly string[]} meshes URLs of the meshes
 * @param {() => void} changed called for each loaded mesh
 * @returns {Promise<Model>}
 */
export async function urdf(three, source, meshes, changed) {
  const [{ default: URDFLoader }, { STLLoader }, page] = await Promise.all([
    import("urdf-loader"),
    import("three/addons/loaders/STLLoader.js"),
    "url" in source ? fetchXml(source.url) : documentOf(source.text),
  ]);
  if (!page.querySelector("robot > link")) throw new Error("the file holds no robot with links");
  /** @type {string[]} */
  const missing = [];
  const loader = new URDFLoader();
  loader.packages = (/** @type {string} */ name) => name;
  loader.workingPath = "";
  loader.loadMeshCb = (path, _, material, done) => {
    const found = fileOf(path, meshes);
    const fail = () => {
      missing.push(path);
      done(new three.Group());
      changed();
    };
    if (!found || !/\.stl$/i.test(found)) {
      fail();
      return;
    }
    void (async () => {
      try {
        if (material instanceof three.MeshPhongMaterial && !material.name) material.color.setHex(BARE);
        const answer = await fetch(found, { signal: AbortSignal.timeout(WAIT_MS) });
        if (!answer.ok) throw new Error(answer.statusText);
        const geometry = new STLLoader().parse(await answer.arrayBuffer());
        done(new three.Mesh(geometry, material));
        changed();
      } catch {
        fail();
      }
    })();
  };
  const robot = loader.parse(page);
  // Three.js draws parts without a material in white, which is invisible on a light page.
  robot.traverse((/** @type {any} */ { material }) => {
    if (material && !material.name && material.color?.getHex() === 0xffffff) material.color.setHex(BARE);
  });
  const moving = Object.values(robot.joints).filter((joint) => joint.jointType !== "fixed");
  return {
    object: robot,
    joints: moving.map((joint) => joint.urdfName),
    set: (name, value) => void robot.setJointValue(name, value),
    missing,
  };
}

/**
 * Return the file for a path of the model: the file with the longest common ending.
 *
 * @param {string} path path in the model, maybe with a package
 * @param {readonly string[]} files
 */
export function fileOf(path, files) {
  const wanted = path.split("/").reverse();
  let best = "";
  let most = 0;
  for (const file of files) {
    const parts = decodeURIComponent(file).split("/").reverse();
    let same = 0;
    while (same < wanted.length && wanted[same] === parts[same]) same += 1;
    if (same > most) [best, most] = [file, same];
  }
  return best;
}

/**
 * Fetch a file and let the browser parse it as XML, because the page policy forbids markup from text.
 *
 * @param {string} url
 * @returns {Promise<Document>}
 */
function fetchXml(url) {
  return new Promise((done, failed) => {
    const request = new XMLHttpRequest();
    request.open("GET", url);
    request.responseType = "document";
    request.overrideMimeType("application/xml");
    request.timeout = WAIT_MS;
    const fail = () => failed(new Error(`the model could not be loaded: ${request.statusText || "no answer"}`));
    request.onerror = fail;
    request.ontimeout = fail;
    request.onload = () => {
      const page = request.responseXML;
      if (request.status !== 200) fail();
      else if (page) done(page);
      else failed(new Error("the model is no XML"));
    };
    request.send();
  });
}
