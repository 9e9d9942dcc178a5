// @ts-check
/** English is what the pages are written in, so nothing is translated. */
/** @type {Record<string, string>} */
const words = {};
export default words;
