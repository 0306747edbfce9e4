// Find the sections that contain all words of a query. Sphinx finds whole pages only.
const pagesOf = Search.performTermsSearch;

Search.performTermsSearch = (terms, excluded) => {
  const index = Search._index,
    found = [],
    stemmer = new Stemmer(),
    stems = new Map();
  const stem = (word) => stems.get(word) ?? stems.set(word, stemmer.stemWord(word)).get(word);
  const count = (words, term) => words.filter((word) => stem(word).startsWith(term)).length;
  for (const [page, name, anchor, title, text] of terms.size ? SECTIONS : []) {
    const heading = title.toLowerCase().split(/\W+/),
      words = text.split(" ");
    const counts = [...terms].map((term) => count(words, term));
    if (counts.includes(0) || [...excluded].some((term) => count(words, term))) continue;
    const share = [...terms].filter((term) => count(heading, term)).length / terms.size;
    const density = counts.reduce((sum, one) => sum + one) / words.length;
    const score = 10 + 20 * share + 100 * density; // for comparison, a page title has 15
    const file = index.filenames[index.docnames.indexOf(page)];
    const shown = title === name ? title : `${name} > ${title}`;
    found.push([page, shown, `#${anchor}`, null, score, file, SearchResultKind.title]);
  }
  const known = new Set(found.map(([page]) => page));
  return [...pagesOf(terms, excluded).filter(([page]) => !known.has(page)), ...found];
};
