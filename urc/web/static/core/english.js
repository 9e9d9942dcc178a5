// @ts-check
/** The catalogue of English: empty, because the texts of the pages are in English. */
/** @type {Record<string, string>} */
const words = {};
export default words;
