// What the map, the table and the sheets of a report know of each other: which tree is chosen, and
// which trees the filter of the table leaves. Without scripts the page shows all of it as it is.
const selection = {
  tree: 0, // number of the chosen tree, 0: none
  shown: null, // numbers of the trees that the filter leaves; null: all
  watchers: [],
  // `from`: the part of the page that it was chosen in.
  choose(tree, from) {
    this.tree = tree;
    this.watchers.forEach((watcher) => watcher(from));
  },
  show(trees) {
    this.shown = trees;
    this.watchers.forEach((watcher) => watcher('filter'));
  },
  isShown(tree) {
    return this.shown === null || this.shown.has(tree);
  },
};

// A long table is shown in full when it is used: until then the page opens faster.
document.querySelectorAll('.all-trees').forEach((table) => table.classList.add('short'));

function makeElement(name, attributes, text) {
  const element = document.createElement(name);
  Object.entries(attributes || {}).forEach(([key, value]) => element.setAttribute(key, value));
  if (text) element.textContent = text;
  return element;
}
