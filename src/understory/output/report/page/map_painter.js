// Draws the map on a canvas: circles, lines and the image keep their place, and symbols and text
// keep their size on the screen.

const kLeastRadius = 2.6; // pixels: a thinner tree is drawn so large
const kCrowdedRadius = 1.1; // pixels: the same where trees stand close to each other on the screen
const kCrowdedShare = 0.2; // of the mean distance of trees on the screen
const kLabelScale = 7; // pixels per metre from which on trees show their numbers
const kMostLabels = 400;
const kTopStrip = 18; // pixels at the top, where the numbers to the east stand

// 1, 2 or 5 times a power of ten, at most `most`.
function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((k) => k * power).find((length) => length <= most) || power;
}

function lengthText(metres) {
  if (metres >= 1000) return metres / 1000 + ' km';
  return metres >= 1 ? metres + ' m' : Math.round(metres * 100) + ' cm';
}

function paintCircle(pen, look, x, y, radius) {
  pen.fillStyle = look.fill;
  pen.strokeStyle = look.stroke;
  pen.lineWidth = look.width;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fill();
  pen.stroke();
}

// A circle as a small picture, `ratio` pixels of the screen per pixel of the page.
function stampOf(look, radius, ratio) {
  const stamp = document.createElement('canvas');
  stamp.width = Math.ceil(2 * (radius + look.width) * ratio);
  stamp.height = stamp.width;
  const pen = stamp.getContext('2d');
  pen.scale(ratio, ratio);
  const middle = stamp.width / ratio / 2;
  paintCircle(pen, look, middle, middle, radius);
  return stamp;
}

// Draws the map as it is seen: `view.x`, `view.y`: what lies in the upper left corner, units of the
// picture; `view.scale`: pixels per unit.
class MapPainter {
  constructor(canvas, map) {
    this.canvas = canvas;
    this.map = map;
    this.pen = canvas.getContext('2d', { alpha: false });
  }

  paint(view) {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * ratio)) this.canvas.width = Math.round(width * ratio);
    if (this.canvas.height !== Math.round(height * ratio)) this.canvas.height = Math.round(height * ratio);
    const apart = view.scale * Math.sqrt((this.map.width * this.map.height) / (this.map.trees.length || 1));
    const least = Math.min(kLeastRadius, Math.max(kCrowdedRadius, kCrowdedShare * apart));
    Object.assign(this, { view, width, height, least });
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.pen.fillStyle = '#fff';
    this.pen.fillRect(0, 0, width, height);
    this.paintPicture();
    if (!this.map.hidden.thin) this.paintThin(ratio);
    if (this.map.grid) this.paintGrid();
    this.paintCrowns(ratio);
    this.paintTrees(ratio);
    this.paintLines(ratio);
    this.paintSigns();
    this.paintLabels();
    this.paintScale();
    if (this.map.north) this.paintNorth();
  }

  at(point) {
    return [(point.x - this.view.x) * this.view.scale, (point.y - this.view.y) * this.view.scale];
  }

  isSeen([x, y], margin) {
    return x > -margin && y > -margin && x < this.width + margin && y < this.height + margin;
  }

  paintPicture() {
    const { picture } = this.map;
    if (!picture || !picture.image.complete || !picture.image.naturalWidth) return;
    const [x, y, width, height] = picture.box;
    const { scale } = this.view;
    this.pen.imageSmoothingEnabled = (width * scale) / picture.image.naturalWidth < 3;
    this.pen.drawImage(picture.image, ...this.at({ x, y }), width * scale, height * scale);
  }

  radiusOf(tree) {
    return Math.max(this.least, tree.r * this.view.scale);
  }

  paintTrees(ratio) {
    const { pen } = this;
    const stamps = new Map();
    this.map.trees.forEach((tree) => {
      const at = this.at(tree);
      const radius = this.radiusOf(tree);
      if (!this.isSeen(at, radius + 2)) return;
      pen.globalAlpha = selection.isShown(tree.id) ? 1 : 0.2;
      if (radius > this.least) {
        paintCircle(pen, tree.look, ...at, radius);
        return;
      }
      // Most trees of a large stand have the same size on the screen: one stamp for all is fast.
      if (!stamps.has(tree.look)) stamps.set(tree.look, stampOf(tree.look, radius, ratio));
      const stamp = stamps.get(tree.look);
      const size = stamp.width / ratio;
      pen.drawImage(stamp, at[0] - size / 2, at[1] - size / 2, size, size);
    });
    pen.globalAlpha = 1;
  }

  // Outlines of crowns: that of the chosen tree, and all where they are asked for.
  paintCrowns(ratio) {
    const { pen, view, map } = this;
    const k = view.scale * ratio;
    pen.save();
    pen.setTransform(k, 0, 0, k, -view.x * k, -view.y * k);
    const stroke = (crown, colour, width) => {
      pen.strokeStyle = colour;
      pen.lineWidth = width / view.scale;
      pen.stroke(crown.path);
    };
    const shown = map.hidden.crowns ? [] : map.crowns.filter((crown) => selection.isShown(crown.id));
    shown.forEach((crown) => stroke(crown, '#14532d', 1.2));
    map.crowns.filter((crown) => crown.id === selection.tree).forEach((crown) => {
      stroke(crown, '#fff', 5);
      stroke(crown, '#0b5fb0', 2.5);
    });
    pen.restore();
  }

  paintLines(ratio) {
    const { pen, view } = this;
    const k = view.scale * ratio;
    pen.save();
    pen.setTransform(k, 0, 0, k, -view.x * k, -view.y * k);
    this.map.lines.forEach((line) => {
      if (line.look && this.map.hidden.stands) return;
      pen.strokeStyle = line.colour;
      pen.lineWidth = line.width / view.scale;
      pen.setLineDash(line.dashed ? [4 / view.scale, 4 / view.scale] : []);
      pen.stroke(line.path);
    });
    pen.restore();
  }

  paintSigns() {
    const { pen } = this;
    pen.fillStyle = '#8e3fb0';
    this.map.dots.forEach((dot) => {
      const [x, y] = this.at(dot);
      pen.globalAlpha = dot.opacity;
      pen.fillRect(x - 2, y - 2, 4, 4);
    });
    pen.globalAlpha = 1;
    pen.strokeStyle = '#1b1b1b';
    pen.lineWidth = 2;
    this.map.crosses.forEach((cross) => {
      const [x, y] = this.at(cross);
      pen.beginPath();
      pen.moveTo(x - 5, y - 5);
      pen.lineTo(x + 5, y + 5);
      pen.moveTo(x + 5, y - 5);
      pen.lineTo(x - 5, y + 5);
      pen.stroke();
    });
    this.map.marks.forEach((mark) => this.paintMark(mark));
    if (!this.map.hidden.stands) this.map.stands.forEach((stand) => this.paintStand(stand));
  }

  // Where to stand, with its number.
  paintStand(stand) {
    const { pen } = this;
    const [x, y] = this.at(stand);
    pen.fillStyle = '#ffd21f';
    pen.strokeStyle = '#111';
    pen.lineWidth = 1.5;
    pen.fillRect(x - 11, y - 9, 22, 18);
    pen.strokeRect(x - 11, y - 9, 22, 18);
    pen.font = '700 14px system-ui, sans-serif';
    pen.textAlign = 'center';
    pen.fillStyle = '#111';
    pen.fillText(stand.text, x, y + 5);
  }

  // Hatched, with lines that stay apart on the screen.
  paintThin(ratio) {
    const { pen, view } = this;
    if (this.map.thin.length === 0) return;
    const k = view.scale * ratio;
    pen.save();
    pen.setTransform(k, 0, 0, k, -view.x * k, -view.y * k);
    pen.beginPath();
    const area = new Path2D();
    this.map.thin.forEach((part) => area.addPath(part));
    pen.clip(area);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.strokeStyle = 'rgba(91,42,134,.5)';
    pen.lineWidth = 1.5;
    for (let x = -this.height; x < this.width; x += 10) {
      pen.moveTo(x, this.height);
      pen.lineTo(x + this.height, 0);
    }
    pen.stroke();
    pen.restore();
  }

  paintMark(mark) {
    const [x, y] = this.at(mark);
    this.pen.fillStyle = '#fff';
    this.pen.strokeStyle = '#111';
    this.pen.beginPath();
    this.pen.arc(x, y, 6, 0, 2 * Math.PI);
    this.pen.fill();
    this.pen.stroke();
    this.write(mark.text, x + 9, y + 5, '600 15px', 'left');
  }

  // Dark text with a light border, to be read on any ground.
  write(text, x, y, font, align) {
    const { pen } = this;
    pen.font = font + ' system-ui, sans-serif';
    pen.textAlign = align;
    pen.lineJoin = 'round';
    pen.lineWidth = 3.5;
    pen.strokeStyle = '#fff';
    pen.strokeText(text, x, y);
    pen.fillStyle = '#111';
    pen.fillText(text, x, y);
  }

  // Numbers of trees, the thickest first, where they do not cover each other.
  paintLabels() {
    const chosen = this.map.trees.filter((tree) => tree.id === selection.tree);
    const taken = new Set();
    const near = this.view.scale * this.map.unitsPerMetre >= kLabelScale;
    const trees = near ? chosen.concat(this.map.byRadius) : chosen;
    let labels = 0;
    for (const tree of trees) {
      const at = this.at(tree);
      if (labels >= kMostLabels) break;
      if (!this.isSeen(at, 0) || !selection.isShown(tree.id)) continue;
      if (this.paintLabel(tree, at, taken)) labels += 1;
    }
    chosen.forEach((tree) => this.paintRing(tree));
  }

  paintLabel(tree, [x, y], taken) {
    const text = String(tree.id);
    const left = x + this.radiusOf(tree) + (tree.id === selection.tree ? 10 : 3);
    const cells = [];
    for (let column = Math.floor(left / 8); column <= (left + 8 * text.length) / 8; column += 1) {
      for (let row = Math.floor((y - 8) / 8); row <= (y + 5) / 8; row += 1) cells.push(column + ',' + row);
    }
    if (cells.some((cell) => taken.has(cell))) return false;
    cells.forEach((cell) => taken.add(cell));
    this.write(text, left, y + 4, '12px', 'left');
    return true;
  }

  paintRing(tree) {
    const { pen } = this;
    const radius = this.radiusOf(tree) + 5;
    [['#fff', 6], ['#0b5fb0', 3]].forEach(([colour, width]) => {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.beginPath();
      pen.arc(...this.at(tree), radius, 0, 2 * Math.PI);
      pen.stroke();
    });
  }

  // Lines of round coordinates, at least 140 pixels apart.
  paintGrid() {
    const { pen, map, view } = this;
    const west = map.x(view.x);
    const north = map.y(view.y);
    const step = 2 * roundLength(140 * (map.x(view.x + 1 / view.scale) - west));
    const digits = Math.max(0, -Math.floor(Math.log10(step)));
    pen.strokeStyle = 'rgba(17,17,17,.35)';
    pen.lineWidth = 0.7;
    for (let east = Math.ceil(west / step) * step; ; east += step) {
      const x = ((east - map.x(0)) / (map.x(1) - map.x(0)) - view.x) * view.scale;
      if (x > this.width) break;
      pen.strokeStyle = 'rgba(17,17,17,.35)';
      pen.lineWidth = 0.7;
      pen.strokeRect(x, -5, 0, this.height + 10);
      // Not below the north arrow.
      if (!map.north || x < this.width - 64) this.write('E ' + east.toFixed(digits), x, 14, '12px', 'center');
    }
    for (let line = Math.floor(north / step) * step; ; line -= step) {
      const y = ((map.y(0) - line) / (map.y(0) - map.y(1)) - view.y) * view.scale;
      if (y > this.height) break;
      pen.strokeStyle = 'rgba(17,17,17,.35)';
      pen.lineWidth = 0.7;
      pen.strokeRect(-5, y, this.width + 10, 0);
      // Above the line, but below the numbers to the east. None where the scale bar is.
      const base = y < kTopStrip + 14 ? Math.max(y + 14, kTopStrip + 14) : y - 4;
      if (y < this.height - 44) this.write('N ' + line.toFixed(digits), 4, base, '12px', 'left');
    }
  }

  paintScale() {
    const { pen } = this;
    const perMetre = this.view.scale * this.map.unitsPerMetre;
    const length = roundLength(Math.min(200, 0.4 * this.width) / perMetre);
    const bottom = this.height - 14;
    const right = 18 + length * perMetre;
    pen.fillStyle = 'rgba(255,255,255,.85)';
    pen.fillRect(10, bottom - 24, right - 2, 32);
    pen.strokeStyle = '#111';
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(18, bottom - 8);
    pen.lineTo(18, bottom);
    pen.lineTo(right, bottom);
    pen.lineTo(right, bottom - 8);
    pen.stroke();
    this.write(lengthText(length), (18 + right) / 2, bottom - 6, '14px', 'center');
  }

  paintNorth() {
    const { pen } = this;
    const x = this.width - 30;
    pen.fillStyle = '#111';
    pen.strokeStyle = '#fff';
    pen.lineWidth = 1;
    const arrow = new Path2D('M' + x + ' 14l9 26-9-6-9 6z');
    pen.fill(arrow);
    pen.stroke(arrow);
    this.write('N', x, 56, '600 15px', 'center');
  }
}
