// The map that can be moved: made from the parts of the still picture (SVG), which stays for print
// and where scripts are off.

// Colours of the trees of each kind, as the page's style has them.
const looks = new Map();
function lookOf(circle) {
  const kind = circle.getAttribute('class');
  if (!looks.has(kind)) {
    const style = getComputedStyle(circle);
    looks.set(kind, { fill: style.fill, stroke: style.stroke, width: parseFloat(style.strokeWidth) });
  }
  return looks.get(kind);
}

// What the still picture holds, in its units.
function readMap(svg) {
  const number = (element, name) => parseFloat(element.getAttribute(name));
  const all = (query) => [...svg.querySelectorAll(query)];
  const image = svg.querySelector('image');
  const map = {
    width: svg.viewBox.baseVal.width,
    height: svg.viewBox.baseVal.height,
    unitsPerMetre: number(svg, 'data-metre'),
    x: (column) => number(svg, 'data-x0') + column / number(svg, 'data-scale'),
    y: (row) => number(svg, 'data-y1') - row / number(svg, 'data-scale'),
    grid: svg.hasAttribute('data-grid'),
    north: svg.querySelector('.north') !== null,
    picture: null,
    hidden: { crowns: true },
    trees: all('.trees circle').map((c) => ({
      id: number(c, 'data-id'), x: number(c, 'cx'), y: number(c, 'cy'), r: number(c, 'data-r'),
      text: c.textContent, look: lookOf(c),
    })),
    thin: all('.thin-area').map((p) => new Path2D(p.getAttribute('d'))),
    crowns: all('.crowns path').map((p) => ({ id: number(p, 'data-id'), path: new Path2D(p.getAttribute('d')) })),
    stands: all('.stand').map((g) => ({
      x: number(g, 'data-x'), y: number(g, 'data-y'), text: g.querySelector('text').textContent,
    })),
    lines: all('.wood path, .look-sights path, .way path, .loops path').map((p) => ({
      path: new Path2D(p.getAttribute('d')), colour: getComputedStyle(p).stroke,
      width: number(p, 'stroke-width'), look: p.parentNode.classList.contains('look-sights'), dashed: p.hasAttribute('stroke-dasharray'),
    })),
    dots: all('.fixes circle').map((c) => ({
      x: number(c, 'cx'), y: number(c, 'cy'), opacity: number(c, 'opacity'),
    })),
    crosses: all('.falls use').map((u) => ({ x: number(u, 'x'), y: number(u, 'y') })),
    marks: all('.mark').map((g) => ({
      x: number(g, 'data-x'), y: number(g, 'data-y'), text: g.textContent,
    })),
  };
  if (image) {
    map.picture = { image: new Image(), box: ['x', 'y', 'width', 'height'].map((k) => number(image, k)) };
    map.picture.image.src = image.getAttribute('href');
  }
  return map;
}

// Boxes that show and hide a layer, for those that the map has.
function addLayers(map, moving, frame) {
  const layers = [['thin', 'thin coverage', map.thin], ['stands', 'walk here', map.stands], ['crowns', 'crowns', map.crowns]];
  const row = makeElement('p', { class: 'layers' });
  layers.filter(([, , parts]) => parts.length > 0).forEach(([name, text]) => {
    const label = makeElement('label');
    const box = makeElement('input', { type: 'checkbox' });
    box.checked = !map.hidden[name];
    box.addEventListener('change', () => {
      map.hidden[name] = !box.checked;
      moving.repaint();
    });
    label.append(box, ' ' + text);
    row.append(label);
  });
  if (row.childElementCount > 0) frame.append(row);
}

function startMap(svg) {
  const map = readMap(svg);
  map.byRadius = [...map.trees].sort((a, b) => b.r - a.r);
  const frame = makeElement('div', { class: 'moving' });
  const canvas = makeElement('canvas', {
    tabindex: '0', role: 'application',
    'aria-label': 'map of the trees: arrow keys move it, plus and minus zoom, 0 shows all of it',
  });
  canvas.style.aspectRatio = map.width + ' / ' + map.height;
  const told = makeElement('p', { class: 'told', 'aria-live': 'polite' });
  const buttons = makeElement('div', { class: 'buttons' });
  frame.append(buttons, canvas, told);
  svg.before(frame);
  svg.classList.add('still');
  const hint = 'Drag to move, wheel or two fingers to zoom, click on a tree to find it in the table.';
  const moving = new MovableMap(canvas, map, (text) => { told.textContent = text || hint; });
  addLayers(map, moving, frame);
  [['+', 'zoom in', () => moving.zoomMiddle(1.5)], ['−', 'zoom out', () => moving.zoomMiddle(1 / 1.5)],
    ['all', 'show the whole map', () => moving.showAll()]].forEach(([text, title, act]) => {
    const button = makeElement('button', { type: 'button', title }, text);
    button.addEventListener('click', act);
    buttons.append(button);
  });
  told.textContent = hint;
  moving.listen();
  if (map.picture) map.picture.image.addEventListener('load', () => moving.repaint());
  selection.watchers.push((from) => moving.follow(from));
  selection.map = moving; // for those who test the page
}

document.querySelectorAll('svg.map').forEach(startMap);
