// The ranking of the site's search, in place of the one that ships with Sphinx.
//
// Sphinx demands every word on a page, and scores a page by its best word alone. Questions such as
// "stick does nothing" then find nothing, or a page of the reference. Here, rare words count more
// than frequent ones, headings more than text, and guides more than records of decisions.
"use strict";

if (typeof Search !== "undefined") (() => {
  const TITLE = 6;
  const HEADING = 3;
  const TEXT = 1;
  const PART = 0.4;
  /** Weight of pages by the start of their name; the first that fits counts. */
  const WEIGHTS = [
    ["how-to/troubleshooting", 1.5],
    ["how-to/", 1.4],
    ["tutorials/", 1.2],
    ["install/", 1.2],
    ["decisions/", 0.3],
    ["reference/keys/", 0.7],
    ["reference/codes", 0.6],
    ["reference/limits", 0.5],
    ["reference/", 0.8],
    ["project/", 0.6],
    ["robots/", 0.7],
    ["tests", 0.4],
    ["threats", 0.5],
  ];
  const MOST = 40;

  const list = (found) => (found === undefined ? [] : Array.isArray(found) ? found : [found]);

  /** Return the pages of an index of terms with a word, or with words that begin like it. */
  function pagesOf(terms, word) {
    const whole = Object.hasOwn(terms, word) ? list(terms[word]) : [];
    if (whole.length || word.length < 4) return { pages: whole, factor: 1 };
    const parts = Object.keys(terms).filter((term) => term.startsWith(word));
    return { pages: parts.flatMap((term) => list(terms[term])), factor: PART };
  }

  const weightOf = (name) => (WEIGHTS.find(([start]) => name.startsWith(start)) ?? ["", 1])[1];

  /** Return the headings of all pages with their stemmed words, made once. */
  function headingsOf(index, stemmer) {
    index.urcHeadings ??= Object.entries(index.alltitles).flatMap(([text, places]) => {
      const words = new Set(splitQuery(text.toLowerCase()).map((word) => stemmer.stemWord(word)));
      return places.map(([page, id]) => ({ text, words, page, id }));
    });
    return index.urcHeadings;
  }

  function rank(index, words) {
    const count = index.docnames.length;
    const stemmer = new Stemmer();
    const scores = new Map();
    const rarity = new Map();
    for (const word of words) {
      const text = pagesOf(index.terms, word);
      const heads = pagesOf(index.titleterms, word);
      const pages = new Set([...text.pages, ...heads.pages]);
      if (!pages.size) continue;
      const rare = Math.log(1 + count / pages.size);
      rarity.set(word, rare);
      const inHeads = new Set(heads.pages);
      for (const page of pages) {
        const one = scores.get(page) ?? { points: 0, found: 0 };
        one.points += rare * (inHeads.has(page) ? HEADING * heads.factor : TEXT * text.factor);
        one.found += 1;
        scores.set(page, one);
      }
    }
    const best = new Map();
    for (const heading of headingsOf(index, stemmer)) {
      const score = scores.get(heading.page);
      if (!score) continue;
      let points = 0;
      for (const word of words) if (heading.words.has(word)) points += rarity.get(word) ?? 0;
      if (!points) continue;
      const isTitle = index.titles[heading.page] === heading.text;
      points *= (isTitle ? TITLE : HEADING) / Math.sqrt(heading.words.size);
      if (points > (best.get(heading.page)?.points ?? 0)) {
        best.set(heading.page, { points, heading, isTitle });
      }
    }
    const results = [];
    for (const [page, { points, found }] of scores) {
      const top = best.get(page);
      const share = found / words.length;
      const score = (points + (top?.points ?? 0)) * share * share * weightOf(index.docnames[page]);
      const isPart = top && !top.isTitle && top.heading.id !== null;
      const title = index.titles[page];
      results.push([
        index.docnames[page],
        isPart ? `${title}: ${top.heading.text}` : title,
        isPart ? `#${top.heading.id}` : "",
        null,
        score,
        index.filenames[page],
        "text",
      ]);
    }
    results.sort((one, other) => one[4] - other[4]); // Sphinx shows the last one first
    return results.slice(-MOST);
  }

  Search._performSearch = (_query, terms) => {
    const progress = document.getElementById("search-progress");
    if (progress) progress.replaceChildren();
    return rank(Search._index, [...terms]);
  };
})();
