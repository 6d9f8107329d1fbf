// One sheet a tree: front view and cross section with what was measured, to look through.

const kCube = 0.04; // metres: a step of the front views
const kPrinted = 6; // sheets in a print: the most doubtful ones
const kStemColour = '#c2500b';
const kTreeColour = '#6fa8cf';
const kStrangerColour = '#c4c4c4';
const kGroundHeight = 0.2; // metres: lower points are ground

function bytesOf(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
}

// A tree of the lines that the page holds; its points are read when it is drawn.
function readSheet(line) {
  const fields = line.split(',');
  const number = (i) => (fields[i] === '' ? NaN : Number(fields[i]));
  return {
    id: number(0), dbh: number(1), sd: number(2), height: number(3), arc: number(4), reach: number(5),
    measuredTo: number(6), seen: BigInt('0x' + fields[7]), outline: fields[8], front: fields[9], section: fields[10],
  };
}

function svgOf(box, label, inside) {
  return '<svg class="paper" viewBox="' + box.map((v) => v.toFixed(3)).join(' ') + '" role="img" aria-label="' + label + '">'
    + inside + '</svg>';
}

function dotsPath(dots, colour, width) {
  if (dots.length === 0) return '';
  const path = dots.map(([x, y]) => 'M' + x.toFixed(3) + ' ' + y.toFixed(3) + 'h0').join('');
  return '<path d="' + path + '" fill="none" stroke="' + colour + '" stroke-width="' + width + '" stroke-linecap="round"/>';
}

function lineText(x, y, size, anchor, text) {
  return '<text x="' + x.toFixed(3) + '" y="' + y.toFixed(3) + '" font-size="' + size + '" text-anchor="' + anchor + '">' + text + '</text>';
}

// The points of a front view by what they are.
function frontDots(sheet) {
  const bytes = bytesOf(sheet.front);
  const dots = { stem: [], tree: [], stranger: [], ground: [], top: 3.5 };
  for (let i = 0; i + 2 < bytes.length; i += 3) {
    const word = bytes[i + 1] + 256 * bytes[i + 2];
    const x = (bytes[i] - 127.5) * kCube;
    const height = ((word & 0x3fff) + 0.5) * kCube;
    dots.top = Math.max(dots.top, height);
    const kind = word & 0x8000 ? 'stem' : (word & 0x4000 ? 'stranger' : 'tree');
    dots[height < kGroundHeight ? 'ground' : kind].push([x, -height]);
  }
  return dots;
}

// Both edges of a stem, as far as it was measured and beyond.
function outlinePaths(sheet, size) {
  const sections = sheet.outline.split('|').map((part) => part.split(' ').map((v) => Number(v) / 100));
  const edge = (side, from) => {
    const part = sections.filter((s) => (from ? s[0] >= sheet.measuredTo - 1 : s[0] <= sheet.measuredTo + 0.05 || Number.isNaN(sheet.measuredTo)));
    return part.map((s, i) => (i ? 'L' : 'M') + (s[1] + side * s[2] / 2).toFixed(3) + ' ' + (-s[0]).toFixed(3)).join('');
  };
  const draw = (path, dash) => (path === '' ? '' : '<path d="' + path + '" fill="none" stroke="#111" stroke-width="' + size / 9
    + '"' + (dash ? ' stroke-dasharray="' + size / 3 + ' ' + size / 4 + '"' : '') + '/>');
  return draw(edge(-1, false) + edge(1, false), false) + (sheet.measuredTo > 0 ? draw(edge(-1, true) + edge(1, true), true) : '');
}

function frontView(sheet) {
  const dots = frontDots(sheet);
  const size = dots.top / 26; // of the text, metres
  const left = -2.1 - 3.6 * size;
  const step = dots.top > 12 ? 5 : 1;
  let axis = '';
  for (let height = 0; height <= dots.top; height += step) {
    axis += '<path d="M-2.1 ' + -height + 'h-' + size / 2 + '" stroke="#555" stroke-width="' + size / 14 + '"/>'
      + lineText(-2.1 - 0.7 * size, -height + 0.35 * size, size, 'end', height + ' m');
  }
  const width = Math.max(0.05, dots.top / 200);
  return svgOf([left, -dots.top - size, 2.1 - left, dots.top + 2 * size], 'front view of tree ' + sheet.id,
    dotsPath(dots.stranger, kStrangerColour, width) + dotsPath(dots.ground, '#8a8a8a', width)
    + dotsPath(dots.tree, kTreeColour, width) + dotsPath(dots.stem, kStemColour, width) + outlinePaths(sheet, size) + axis);
}

// Points of the slice, the circle, its standard deviation (dashed) and the sides that were seen
// (outer ring).
function crossSection(sheet) {
  const bytes = bytesOf(sheet.section);
  const { reach } = sheet;
  const dots = [];
  for (let i = 0; i + 1 < bytes.length; i += 2) dots.push([(bytes[i] - 128) / 127 * reach, -(bytes[i + 1] - 128) / 127 * reach]);
  const size = reach / 9;
  const circle = (r, style) => (r > 0 ? '<circle r="' + r.toFixed(4) + '" fill="none" ' + style + '/>' : '');
  const radius = sheet.dbh / 200;
  const sd = sheet.sd / 200;
  const thin = 'stroke="#b3372b" stroke-width="' + reach / 130 + '" stroke-dasharray="' + reach / 25 + ' ' + reach / 40 + '"';
  let ring = '';
  for (let side = 0; side < 36; side += 1) {
    if (((sheet.seen >> BigInt(side)) & 1n) === 0n) continue;
    const at = (degrees) => {
      const angle = degrees * Math.PI / 180;
      return (1.04 * reach * Math.cos(angle)).toFixed(4) + ' ' + (-1.04 * reach * Math.sin(angle)).toFixed(4);
    };
    const r = (1.04 * reach).toFixed(4);
    ring += 'M' + at(10 * side) + 'A' + r + ' ' + r + ' 0 0 0 ' + at(10 * side + 10);
  }
  const half = 1.12 * reach;
  const bar = '<path d="M' + (-half + size) + ' ' + (half + size) + 'h0.1" stroke="#111" stroke-width="' + size / 5 + '"/>'
    + lineText(-half + size + 0.1 + size / 2, half + 1.4 * size, size, 'start', '10 cm');
  return svgOf([-half, -half, 2 * half, 2 * half + 2 * size], 'cross section of tree ' + sheet.id,
    dotsPath(dots, '#2d3430', reach / 50)
    + circle(radius, 'stroke="#b3372b" stroke-width="' + reach / 60 + '"') + circle(radius - sd, thin) + circle(radius + sd, thin)
    + '<path d="' + ring + '" fill="none" stroke="#0b5fb0" stroke-width="' + reach / 22 + '"/>' + bar);
}

function factsOf(sheet) {
  const facts = ['<b>Tree ' + sheet.id + '</b>'];
  const share = Math.round(100 * sheet.sd / sheet.dbh);
  facts.push('diameter ' + sheet.dbh + (sheet.sd >= 0 ? ' ± ' + sheet.sd + ' cm (' + share + ' %)' : ' cm'));
  facts.push(sheet.height > 0 ? 'height ' + sheet.height + ' m' : 'height not known');
  if (sheet.arc >= 0) facts.push('seen: ' + sheet.arc + '° of the circumference');
  return facts.join(' · ');
}

function drawSheet(box, sheet) {
  box.innerHTML = '<p class="facts">' + factsOf(sheet) + '</p><div class="sheet"><figure>' + (sheet.front === '' ? '' : frontView(sheet))
    + '</figure><figure>' + crossSection(sheet) + '</figure></div>';
}

class SheetViewer {
  constructor(box, sheets) {
    this.sheets = sheets; // the most doubtful first
    this.order = [...sheets];
    this.at = 0;
    this.paper = makeElement('div', {});
    this.place = makeElement('span', { 'aria-live': 'polite' });
    const bar = makeElement('p', { class: 'sheet-bar' });
    bar.append(this.button('◀ previous', -1), this.button('next ▶', 1), this.place, this.orderChoice());
    const legend = makeElement('p', { class: 'legend' });
    legend.innerHTML = [['stem', kStemColour], ['around it', kTreeColour], ['of another tree', kStrangerColour]]
      .map(([text, colour]) => '<span><i class="box" style="background:' + colour + '"></i>' + text + '</span>').join(' ')
      + ' <span><i style="border-color:#111"></i>outline (dashed: not measured)</span> <span><i style="border-color:#b3372b"></i>fitted circle ± (dashed)</span>'
      + ' <span><i style="border-color:#0b5fb0"></i>sides that were seen</span>';
    box.append(bar, this.paper, legend);
    box.tabIndex = 0;
    box.addEventListener('keydown', (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step || event.target !== box) return;
      this.go(step);
      event.preventDefault();
    });
    this.draw();
  }

  button(text, step) {
    const button = makeElement('button', { type: 'button' }, text);
    button.addEventListener('click', () => this.go(step));
    return button;
  }

  orderChoice() {
    const orders = {
      'most doubtful first': null, 'by number': (a, b) => a.id - b.id, 'thickest first': (a, b) => b.dbh - a.dbh,
    };
    const choice = makeElement('select', { 'aria-label': 'order of the sheets' });
    Object.keys(orders).forEach((name) => choice.append(makeElement('option', {}, name)));
    choice.addEventListener('change', () => {
      const order = orders[choice.value];
      this.order = order ? [...this.sheets].sort(order) : [...this.sheets];
      this.at = 0;
      this.draw();
    });
    return choice;
  }

  go(step) {
    this.at = (this.at + step + this.order.length) % this.order.length;
    selection.choose(this.order[this.at].id, 'sheets');
  }

  draw() {
    this.place.textContent = ' ' + (this.at + 1) + ' of ' + this.order.length + ' ';
    drawSheet(this.paper, this.order[this.at]);
  }

  follow(from) {
    if (from === 'filter') return;
    const at = this.order.findIndex((sheet) => sheet.id === selection.tree);
    if (at < 0) return;
    this.at = at;
    this.draw();
  }
}

document.querySelectorAll('.sheet-data').forEach((data) => {
  const sheets = data.textContent.trim().split('\n').map(readSheet);
  const box = document.querySelector('.sheets');
  box.replaceChildren();
  const viewer = new SheetViewer(box, sheets);
  selection.watchers.push((from) => viewer.follow(from));
  const print = makeElement('div', { class: 'sheets-print' });
  box.after(print);
  window.addEventListener('beforeprint', () => {
    print.replaceChildren();
    const chosen = sheets.filter((sheet, i) => i < kPrinted || sheet.id === selection.tree);
    chosen.forEach((sheet) => {
      const place = makeElement('div', { class: 'printed' });
      drawSheet(place, sheet);
      print.append(place);
    });
  });
});
