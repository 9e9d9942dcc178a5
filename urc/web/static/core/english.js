// @ts-check
/** The English catalogue, which is empty, because the texts of the pages are in English. */
/** @type {Record<string, string>} */
const words = {};
export default words;
