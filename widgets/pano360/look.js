// @ts-check
/**
 * The viewing direction in a panorama, and the pose in its file. Pure: no DOM.
 *
 * Yaw is in degrees to the left of the image's middle (REP 103), pitch in degrees upwards.
 *
 * @typedef {object} View
 * @property {number} yaw -180 to 180
 * @property {number} pitch -90 to 90
 * @property {number} fov degrees along the shorter side
 *
 * @typedef {object} Pose Metadata of the file (Photo Sphere XMP).
 * @property {number} heading heading of the image's middle, degrees clockwise from north; NaN if unknown
 * @property {number} pitch pitch of the camera, degrees upwards
 * @property {number} roll roll of the camera, degrees
 * @property {number} startHeading first viewing direction in the image; NaN if unknown
 * @property {number} startPitch
 */

export const MOST_XMP = 256 * 1024;
const PITCH = 89;

/**
 * @param {number} yaw
 */
export function wrapped(yaw) {
  return ((((yaw + 180) % 360) + 360) % 360) - 180;
}

/**
 * @param {View} view
 * @param {{yaw?: number, pitch?: number, zoom?: number}} change degrees; zoom is a factor of the fov
 * @returns {View}
 */
export function turned(view, { yaw = 0, pitch = 0, zoom = 1 }) {
  return {
    yaw: wrapped(view.yaw + yaw),
    pitch: Math.min(PITCH, Math.max(-PITCH, view.pitch + pitch)),
    fov: Math.min(110, Math.max(20, view.fov * zoom)),
  };
}

/**
 * Return the point in the viewing direction at distance 1: x right, y up, z back, as in three.js.
 *
 * @param {View} view
 * @returns {[number, number, number]}
 */
export function target({ yaw, pitch }) {
  const [across, up] = [(yaw * Math.PI) / 180, (pitch * Math.PI) / 180];
  return [-Math.sin(across) * Math.cos(up), Math.sin(up), -Math.cos(across) * Math.cos(up)];
}

/**
 * Return the visible part of the flat image, as fractions of the image; left may be below 0 or above 1.
 *
 * @param {View} view
 * @param {number} aspect width by height of the box
 */
export function crop({ yaw, pitch, fov }, aspect) {
  const height = Math.min(1, fov / Math.min(1, aspect) / 180);
  const width = Math.min(1, (fov * Math.max(1, aspect)) / 360);
  const middle = 0.5 - yaw / 360;
  const top = Math.min(1 - height, Math.max(0, 0.5 - pitch / 180 - height / 2));
  return { left: middle - width / 2, top, width, height };
}

/**
 * Return the vertical field of view in degrees, for a field of view along the shorter side.
 *
 * @param {View} view
 * @param {number} aspect width by height
 */
export function verticalFov({ fov }, aspect) {
  if (aspect >= 1) return fov;
  const half = Math.tan((fov * Math.PI) / 360) / Math.max(aspect, 0.2);
  return (Math.atan(half) * 360) / Math.PI;
}

/**
 * Return the change of the viewing direction by a tilted device.
 *
 * @param {{alpha: number, beta: number}} now degrees, from the device
 * @param {{alpha: number, beta: number}} start
 */
export function tilted(now, start) {
  return { yaw: wrapped(now.alpha - start.alpha), pitch: Math.max(-180, Math.min(180, now.beta - start.beta)) };
}

/**
 * Return the pose in the file's metadata, or null.
 *
 * @param {Uint8Array} bytes the beginning of a JPEG
 * @returns {Pose | null}
 */
export function poseOf(bytes) {
  const text = new TextDecoder("latin1").decode(bytes.subarray(0, MOST_XMP));
  if (!text.includes("GPano:")) return null;
  const number = (/** @type {string} */ name) => {
    const pattern = new RegExp(`GPano:${name}(?:="|>)\\s*([-+]?\\d{1,6}(?:\\.\\d{1,9})?)\\s*["<]`);
    const found = pattern.exec(text)?.[1];
    return found === undefined ? NaN : Number(found);
  };
  return {
    heading: number("PoseHeadingDegrees"),
    pitch: number("PosePitchDegrees") || 0,
    roll: number("PoseRollDegrees") || 0,
    startHeading: number("InitialViewHeadingDegrees"),
    startPitch: number("InitialViewPitchDegrees") || 0,
  };
}

/**
 * Return the first view of an image, from its file or otherwise from the options.
 *
 * @param {Pose | null} pose
 * @param {View} otherwise
 * @returns {View}
 */
export function firstView(pose, otherwise) {
  if (!pose || Number.isNaN(pose.startHeading)) return otherwise;
  // The file contains angles clockwise from north, and the heading of the image's middle.
  const middle = Number.isNaN(pose.heading) ? 0 : pose.heading;
  return turned(
    { ...otherwise, yaw: 0, pitch: 0 },
    { yaw: middle - pose.startHeading, pitch: pose.startPitch },
  );
}

/**
 * Return the viewing direction as a bearing; NaN without a heading in the file.
 *
 * @param {Pose | null} pose
 * @param {View} view
 */
export function bearing(pose, view) {
  if (!pose || Number.isNaN(pose.heading)) return NaN;
  return (((pose.heading - view.yaw) % 360) + 360) % 360;
}
