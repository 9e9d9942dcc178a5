// @ts-check
/**
 * The renderer of the panorama: a sphere from the inside or, without WebGL, a part of the flat image.
 *
 * @typedef {import("./look.js").Pose} Pose
 * @typedef {import("./look.js").View} View
 *
 * @typedef {object} ViewSwitch
 * @property {HTMLCanvasElement} canvas
 * @property {(bitmap: ImageBitmap, pose: Pose | null) => void} show
 * @property {(view: View) => void} draw
 * @property {(width: number, height: number) => void} resize CSS pixels
 * @property {() => void} end
 */
import { board } from "urc/kit";
import { crop, target, verticalFov } from "./look.js";

/** Maximum pixel density: a higher density is not visible and fills the memory of a phone. */
const MOST_DENSITY = 1.5;

/**
 * @param {typeof import("three")} three
 * @returns {ViewSwitch} throws without WebGL
 */
export function sphere(three) {
  const renderer = new three.WebGLRenderer({ antialias: false, powerPreference: "low-power" });
  renderer.setPixelRatio(Math.min(MOST_DENSITY, globalThis.devicePixelRatio || 1));
  const scene = new three.Scene();
  const camera = new three.PerspectiveCamera(75, 1, 0.1, 10);
  // Mirrored because the viewer is inside, and rotated so that the middle of the image is ahead.
  const geometry = new three.SphereGeometry(1, 48, 32).scale(-1, 1, 1).rotateY(-Math.PI / 2);
  const material = new three.MeshBasicMaterial();
  const ball = new three.Mesh(geometry, material);
  ball.rotation.order = "ZXY";
  scene.add(ball);
  /** @type {import("three").Texture | null} */
  let texture = null;
  return {
    canvas: renderer.domElement,
    show(bitmap, pose) {
      // Another size needs a new texture, because a texture cannot be resized.
      const old = /** @type {ImageBitmap | undefined} */ (texture?.image);
      if (!texture || old?.width !== bitmap.width || old.height !== bitmap.height) {
        texture?.dispose();
        texture = new three.Texture(bitmap);
        texture.colorSpace = three.SRGBColorSpace;
        texture.generateMipmaps = false;
        texture.minFilter = three.LinearFilter;
        // The first row of a bitmap is the top row, and WebGL does not flip bitmaps.
        texture.flipY = false;
        texture.repeat.y = -1;
        texture.offset.y = 1;
        material.map = texture;
        material.needsUpdate = true;
      }
      texture.image = bitmap;
      texture.needsUpdate = true;
      const radians = (/** @type {number} */ degrees) => (degrees * Math.PI) / 180;
      ball.rotation.set(radians(pose?.pitch ?? 0), 0, -radians(pose?.roll ?? 0));
    },
    draw(view) {
      if (!texture) return;
      camera.fov = verticalFov(view, camera.aspect);
      camera.updateProjectionMatrix();
      camera.lookAt(...target(view));
      renderer.render(scene, camera);
    },
    resize(width, height) {
      renderer.setSize(width, height, false);
      camera.aspect = width / Math.max(1, height);
    },
    end() {
      texture?.dispose();
      geometry.dispose();
      material.dispose();
      renderer.dispose();
      renderer.forceContextLoss(); // browsers allow only about sixteen contexts
    },
  };
}

/** @returns {ViewSwitch} */
export function flat() {
  const canvas = document.createElement("canvas");
  /** @type {ImageBitmap | null} */
  let shown = null;
  let size = { width: 1, height: 1 };
  return {
    canvas,
    show(bitmap) {
      shown = bitmap;
    },
    draw(view) {
      if (!shown || shown.width === 0) return;
      const pen = board(canvas, size);
      const part = crop(view, size.width / Math.max(1, size.height));
      const scale = size.width / part.width;
      // The image wraps around: its right edge adjoins its left edge.
      const first = Math.floor(part.left);
      for (let copy = first; copy < part.left + part.width; copy += 1) {
        const x = (copy - part.left) * scale;
        pen.drawImage(shown, 0, part.top * shown.height, shown.width, part.height * shown.height, x, 0, scale, size.height);
      }
    },
    resize(width, height) {
      size = { width, height };
    },
    end() {
      shown = null;
    },
  };
}
