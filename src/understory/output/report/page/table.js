// Tables that a click on a head sorts; the table of trees can be filtered too, and goes with the
// map.

// Empty cells come last, whatever the direction.
function sortRows(body, column, direction) {
  const key = (row) => {
    const text = row.cells[column].textContent;
    const value = parseFloat(text);
    return { row, empty: text === '', value: Number.isNaN(value) ? text : value };
  };
  const order = (a, b) => {
    if (a.empty !== b.empty) return a.empty ? 1 : -1;
    return a.value < b.value ? -direction : Number(a.value > b.value) * direction;
  };
  body.append(...[...body.rows].map(key).sort(order).map((k) => k.row));
}

function makeSortable(table) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    head.tabIndex = 0;
    head.title = 'sort';
    const sort = () => {
      const direction = head.getAttribute('aria-sort') === 'ascending' ? -1 : 1;
      heads.forEach((h) => h.removeAttribute('aria-sort'));
      head.setAttribute('aria-sort', direction > 0 ? 'ascending' : 'descending');
      sortRows(table.tBodies[0], column, direction);
    };
    head.addEventListener('click', sort);
    head.addEventListener('keydown', (event) => { if (event.key === 'Enter') sort(); });
  });
}

// ">20", "<= 3", "10..20", "20"; "-": nothing in the cell. Null: not understood, so it filters
// nothing.
function testOf(text) {
  const wanted = text.replace(/\s/g, '').replace(',', '.');
  if (wanted === '-') return (cell) => cell === '';
  const range = wanted.match(/^(-?[\d.]+)\.\.(-?[\d.]+)$/);
  if (range) return (cell) => parseFloat(cell) >= Number(range[1]) && parseFloat(cell) <= Number(range[2]);
  const bound = wanted.match(/^([<>]=?|=?)(-?[\d.]+)$/);
  if (!bound) return null;
  const value = Number(bound[2]);
  const tests = {
    '<': (x) => x < value, '<=': (x) => x <= value, '>': (x) => x > value, '>=': (x) => x >= value,
    '=': (x) => x === value, '': (x) => x === value,
  };
  return (cell) => tests[bound[1]](parseFloat(cell));
}

class TreeTable {
  constructor(table) {
    this.table = table;
    this.body = table.tBodies[0];
    this.box = table.closest('.scroll');
    this.rows = new Map([...this.body.rows].map((row) => [Number(row.cells[0].textContent), row]));
    this.addFilters();
    this.body.addEventListener('click', (event) => this.pick(event.target.closest('tr')));
    this.box.tabIndex = 0;
    this.box.addEventListener('scroll', () => this.lengthen(), { once: true });
    this.box.addEventListener('keydown', (event) => this.press(event));
  }

  lengthen() {
    this.box.closest('.all-trees').classList.remove('short');
  }

  pick(row) {
    if (row) selection.choose(Number(row.cells[0].textContent), 'table');
  }

  addFilters() {
    const row = this.table.tHead.insertRow();
    row.className = 'filters';
    this.filters = [...this.table.tHead.rows[0].cells].map((head) => {
      const input = makeElement('input', {
        'aria-label': 'filter: ' + head.textContent, placeholder: 'filter',
        title: '20, >20, <=20, 10..20; - for empty cells',
      });
      const cell = makeElement('th', { class: 'n' });
      cell.append(input);
      row.append(cell);
      input.addEventListener('input', () => this.filter());
      return input;
    });
    this.count = makeElement('p', { class: 'so count', 'aria-live': 'polite' });
    this.box.before(this.count);
    this.tellCount(this.rows.size);
  }

  tellCount(count) {
    const { size } = this.rows;
    this.count.textContent = count === size
      ? 'Click on a row: the map shows the tree. Click on a head to sort. Filter with >20, <5, 10..20 or - (empty).'
      : count + ' of ' + size + ' trees. The others are pale on the map.';
  }

  filter() {
    this.lengthen();
    const tests = this.filters.map((input) => {
      const text = input.value.trim();
      const test = text === '' ? null : testOf(text);
      input.classList.toggle('wrong', text !== '' && !test);
      return test;
    });
    const shown = new Set();
    this.rows.forEach((row, tree) => {
      const fits = tests.every((test, i) => !test || test(row.cells[i].textContent));
      row.hidden = !fits;
      if (fits) shown.add(tree);
    });
    this.tellCount(shown.size);
    selection.show(shown.size === this.rows.size ? null : shown);
  }

  // Arrow keys go to the next and the last tree.
  press(event) {
    if (event.target !== this.box || !['ArrowDown', 'ArrowUp'].includes(event.key)) return;
    const rows = [...this.body.rows].filter((row) => !row.hidden);
    const at = rows.indexOf(this.rows.get(selection.tree));
    this.pick(rows[Math.min(Math.max(at + (event.key === 'ArrowDown' ? 1 : -1), 0), rows.length - 1)]);
    event.preventDefault();
  }

  follow(from) {
    if (from === 'filter') return;
    this.body.querySelectorAll('.chosen').forEach((row) => row.classList.remove('chosen'));
    const row = this.rows.get(selection.tree);
    if (!row) return;
    this.lengthen();
    row.classList.add('chosen');
    const inside = row.offsetTop - this.table.tHead.offsetHeight;
    const high = this.box.clientHeight - this.table.tHead.offsetHeight;
    // Only the box moves, not the page.
    if (inside < this.box.scrollTop || inside > this.box.scrollTop + high - row.offsetHeight) this.box.scrollTop = inside - high / 2;
  }

  // Map and table are seen together on a screen; in print the table keeps its place.
  moveTo(map) {
    const place = this.box.closest('.all-trees');
    const home = makeElement('span', { hidden: '' });
    place.before(home);
    const move = () => map.querySelector('.legend').after(place);
    window.addEventListener('beforeprint', () => home.after(place));
    window.addEventListener('afterprint', move);
    move();
  }
}

document.querySelectorAll('table.sort').forEach(makeSortable);
document.querySelectorAll('.all-trees table').forEach((table) => {
  const trees = new TreeTable(table);
  const map = document.querySelector('.moving');
  if (map) trees.moveTo(map.closest('section'));
  selection.watchers.push((from) => trees.follow(from));
});
