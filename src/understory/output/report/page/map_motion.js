// How the map is moved by mouse, wheel, fingers and keys.

const kReach = 10; // pixels around a click in which a tree is found
const kClosest = 60; // pixels per metre at which a tree from the table is shown
const kMostScale = 2000; // pixels per metre

// Where the map stands, and how it moves.
class MovableMap {
  constructor(canvas, map, tell) {
    Object.assign(this, { canvas, map, tell });
    this.painter = new MapPainter(canvas, map);
    this.asked = false;
    this.fingers = new Map();
    this.showAll();
  }

  least() {
    return Math.min(this.canvas.clientWidth / this.map.width, this.canvas.clientHeight / this.map.height);
  }

  showAll() {
    const scale = this.least();
    this.view = {
      scale,
      x: (this.map.width - this.canvas.clientWidth / scale) / 2,
      y: (this.map.height - this.canvas.clientHeight / scale) / 2,
    };
    this.repaint();
  }

  repaint() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.painter.paint(this.view);
    });
  }

  // The middle of the window stays over the map.
  move(dx, dy) {
    const { view, canvas, map } = this;
    const halfX = canvas.clientWidth / view.scale / 2;
    const halfY = canvas.clientHeight / view.scale / 2;
    const within = (value, most) => Math.min(Math.max(value, 0), most);
    view.x = within(view.x + halfX - dx / view.scale, map.width) - halfX;
    view.y = within(view.y + halfY - dy / view.scale, map.height) - halfY;
    this.repaint();
  }

  // `x`, `y`: the pixel that stays in its place. Returns whether anything changed.
  zoom(factor, x, y) {
    const { view } = this;
    const most = kMostScale / this.map.unitsPerMetre;
    const scale = Math.min(Math.max(view.scale * factor, this.least()), most);
    if (scale === view.scale) return false;
    if (scale === this.least()) {
      this.showAll();
      return true;
    }
    view.x += x / view.scale - x / scale;
    view.y += y / view.scale - y / scale;
    view.scale = scale;
    this.move(0, 0);
    return true;
  }

  zoomMiddle(factor) {
    this.zoom(factor, this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
  }

  centre(point) {
    const scale = Math.max(this.view.scale, kClosest / this.map.unitsPerMetre);
    this.view.scale = scale;
    this.view.x = point.x - this.canvas.clientWidth / scale / 2;
    this.view.y = point.y - this.canvas.clientHeight / scale / 2;
    this.repaint();
  }

  // The tree at a pixel, 0 if none.
  treeAt(x, y) {
    let nearest = 0;
    let least = Infinity;
    this.painter.view = this.view;
    this.map.trees.forEach((tree) => {
      const [tx, ty] = this.painter.at(tree);
      const away = Math.hypot(tx - x, ty - y) - tree.r * this.view.scale;
      if (away < Math.min(least, kReach) && selection.isShown(tree.id)) {
        least = away;
        nearest = tree.id;
      }
    });
    return nearest;
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener('wheel', (event) => {
      const lines = event.deltaMode === 1 ? 20 : 1;
      // Where the whole map is seen already, the page moves on.
      if (this.zoom(Math.exp(-0.0016 * lines * event.deltaY), event.offsetX, event.offsetY)) event.preventDefault();
    }, { passive: false });
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
      if (this.fingers.size === 1) this.moved = 0;
    });
    canvas.addEventListener('pointermove', (event) => this.drag(event));
    canvas.addEventListener('pointerup', (event) => {
      const clicked = this.fingers.size === 1 && this.moved < 5;
      this.fingers.delete(event.pointerId);
      if (clicked) selection.choose(this.treeAt(event.offsetX, event.offsetY), 'map');
    });
    canvas.addEventListener('pointercancel', (event) => this.fingers.delete(event.pointerId));
    canvas.addEventListener('dblclick', (event) => this.zoom(2, event.offsetX, event.offsetY));
    canvas.addEventListener('keydown', (event) => this.press(event));
    new ResizeObserver(() => (this.view.scale <= this.least() ? this.showAll() : this.move(0, 0))).observe(canvas);
  }

  // One finger or the mouse moves the map, two zoom it.
  drag(event) {
    const last = this.fingers.get(event.pointerId);
    if (!last) return;
    const here = { x: event.offsetX, y: event.offsetY };
    const other = [...this.fingers].find(([id]) => id !== event.pointerId);
    this.moved += Math.hypot(here.x - last.x, here.y - last.y);
    this.fingers.set(event.pointerId, here);
    if (!other) {
      this.move(here.x - last.x, here.y - last.y);
      return;
    }
    const away = (point) => Math.hypot(point.x - other[1].x, point.y - other[1].y) || 1;
    this.move((here.x - last.x) / 2, (here.y - last.y) / 2);
    this.zoom(away(here) / away(last), (here.x + other[1].x) / 2, (here.y + other[1].y) / 2);
  }

  press(event) {
    const step = 60;
    const moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (moves[event.key]) this.move(...moves[event.key]);
    else if (event.key === '+' || event.key === '=') this.zoomMiddle(1.5);
    else if (event.key === '-') this.zoomMiddle(1 / 1.5);
    else if (event.key === '0' || event.key === 'Home') this.showAll();
    else if (event.key === 'Escape') selection.choose(0, 'map');
    else return;
    event.preventDefault();
  }

  follow(from) {
    const tree = this.map.trees.find((t) => t.id === selection.tree);
    this.tell(tree ? tree.text : '');
    if (tree && from !== 'map' && from !== 'filter') this.centre(tree);
    else this.repaint();
  }
}
