// The 3D view of a figure: WebGL 2 alone. Bodies are boxes, revolved profiles and triangle meshes.
const pgraphView = (() => {
  const VERTEX = `#version 300 es
in vec3 place; in vec3 normal;
uniform mat4 camera; uniform mat4 model;
out vec3 at; out vec3 facing;
void main() {
  vec4 p = model * vec4(place, 1.0);
  at = p.xyz;
  facing = inverse(transpose(mat3(model))) * normal;
  gl_Position = camera * p;
}`;
  const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at; in vec3 facing;
uniform vec4 color; uniform vec3 eye; uniform vec3 sun; uniform vec3 up; uniform float mode;
uniform float cell; uniform vec3 line; uniform float far;
out vec4 seen;
void main() {
  if (mode > 1.5) { seen = color; return; } // a shadow
  if (mode > 0.5) { // the ground, with its grid
    vec3 flat_ = at - up * dot(at, up);
    vec2 g = up.x > 0.5 ? flat_.yz : up.y > 0.5 ? flat_.xz : flat_.xy;
    vec2 w = fwidth(g / cell);
    vec2 d = abs(fract(g / cell - 0.5) - 0.5) / max(w, vec2(1e-6));
    float on = (1.0 - min(min(d.x, d.y), 1.0)) * (1.0 - smoothstep(0.2, 0.6, max(w.x, w.y)));
    float fade = 1.0 - smoothstep(0.25 * far, far, length(at - eye));
    seen = vec4(mix(color.rgb, line, on), 1.0) * fade;
    return;
  }
  vec3 n = normalize(facing), to = normalize(eye - at);
  if (dot(n, to) < 0.0) n = -n;
  float key = max(dot(n, sun), 0.0), sky = 0.5 + 0.5 * dot(n, up);
  float shine = pow(max(dot(n, normalize(sun + to)), 0.0), 40.0);
  vec3 c = pow(color.rgb, vec3(0.8)) * (0.42 + 0.3 * sky + 0.5 * key) + 0.12 * shine;
  seen = vec4(c, 1.0) * color.a;
}`;
  const ROUND = 28,
    RINGS = 9;

  // -- small linear algebra, columns first --------------------------------------------------------

  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1],
    a[2] * b[0] - a[0] * b[2],
    a[0] * b[1] - a[1] * b[0],
  ];
  const unit = (a) => {
    const n = Math.hypot(...a) || 1;
    return a.map((x) => x / n);
  };

  function times(a, b) {
    const c = new Float32Array(16);
    for (let i = 0; i < 4; i++)
      for (let j = 0; j < 4; j++)
        for (let k = 0; k < 4; k++) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
    return c;
  }

  // -- solids: [places, normals, triangles] --------------------------------------------------------

  function revolved(profile) {
    // [[radius, z, normal out, normal up]] from below
    const places = [],
      normals = [],
      faces = [];
    for (const [r, z, out, up] of profile)
      for (let k = 0; k <= ROUND; k++) {
        const a = (2 * Math.PI * k) / ROUND;
        places.push(r * Math.cos(a), r * Math.sin(a), z);
        normals.push(out * Math.cos(a), out * Math.sin(a), up);
      }
    for (let i = 0; i + 1 < profile.length; i++)
      for (let k = 0; k < ROUND; k++) {
        const a = i * (ROUND + 1) + k,
          b = a + ROUND + 1;
        faces.push(a, a + 1, b, b, a + 1, b + 1);
      }
    return [places, normals, faces];
  }

  function cap(radius, middle, from, to) {
    return Array.from({ length: RINGS }, (_, i) => {
      const a = from + ((to - from) * i) / (RINGS - 1);
      return [radius * Math.cos(a), middle + radius * Math.sin(a), Math.cos(a), Math.sin(a)];
    });
  }

  function solid(piece, meshes) {
    const [x, , z] = piece.size,
      near = x / 2,
      far = near * piece.taper,
      quarter = Math.PI / 2;
    if (piece.kind === "mesh") return facets(...meshes[piece.mesh]);
    if (piece.kind === "sphere") return revolved(cap(0.5, 0, -quarter, quarter));
    if (piece.kind === "capsule") {
      const low = near - z / 2,
        high = Math.max(z / 2 - far, low),
        long = Math.max(high - low, 1e-9);
      const touch = Math.asin(Math.max(-1, Math.min(1, (near - far) / long)));
      return revolved([...cap(near, low, -quarter, touch), ...cap(far, high, touch, quarter)]);
    }
    if (piece.kind === "cylinder") {
      const h = z / 2;
      return revolved([
        [0, -h, 0, -1],
        [near, -h, 0, -1],
        [near, -h, 1, 0],
        [far, h, 1, 0],
        [far, h, 0, 1],
        [0, h, 0, 1],
      ]);
    }
    const places = [],
      faces = [];
    for (let k = 0; k < 8; k++) places.push(...[k & 1, (k >> 1) & 1, k >> 2].map((b) => b - 0.5));
    for (const [a, b, c, d] of [
      [0, 2, 3, 1],
      [4, 5, 7, 6],
      [0, 1, 5, 4],
      [2, 6, 7, 3],
      [0, 4, 6, 2],
      [1, 3, 7, 5],
    ])
      faces.push(a, b, c, a, c, d);
    return facets(places, faces);
  }

  function facets(places, faces) {
    // each triangle with its own normal; smooth where it bends little
    const at = (i) => [places[3 * i], places[3 * i + 1], places[3 * i + 2]],
      own = [],
      around = new Map();
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [faces[f], faces[f + 1], faces[f + 2]].map(at);
      own.push(unit(cross(sub(b, a), sub(c, a))));
      for (let k = 0; k < 3; k++) {
        const key = at(faces[f + k])
          .map((x) => x.toPrecision(7))
          .join();
        around.set(key, [...(around.get(key) || []), f / 3]);
      }
    }
    const out = [],
      normals = [];
    for (let f = 0; f < faces.length; f++) {
      const p = at(faces[f]),
        n = own[Math.floor(f / 3)];
      out.push(...p);
      const near = around
        .get(p.map((x) => x.toPrecision(7)).join())
        .filter((g) => dot(own[g], n) > 0.8);
      normals.push(...unit(near.reduce((sum, g) => add(sum, own[g]), [0, 0, 0])));
    }
    return [out, normals, out.map((_, i) => i).slice(0, faces.length)];
  }

  // -- the view -----------------------------------------------------------------------------------

  class View {
    // `scene`: pieces, meshes, up, center, size, low; raises where there is no WebGL 2.
    constructor(canvas, scene, theme) {
      this.canvas = canvas;
      this.gl = canvas.getContext("webgl2", {
        antialias: true,
        alpha: true,
        stencil: true,
        preserveDrawingBuffer: true,
      });
      if (!this.gl) throw new Error("no WebGL 2");
      this.scene = scene;
      this.theme = theme;
      this.up = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] }[scene.up];
      this.program = this.linked();
      this.solids = new Map();
      this.fit();
      this.listen();
    }

    linked() {
      const gl = this.gl,
        program = gl.createProgram();
      for (const [kind, text] of [
        [gl.VERTEX_SHADER, VERTEX],
        [gl.FRAGMENT_SHADER, FRAGMENT],
      ]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS))
          throw new Error(gl.getShaderInfoLog(shader));
        gl.attachShader(program, shader);
      }
      gl.bindAttribLocation(program, 0, "place");
      gl.bindAttribLocation(program, 1, "normal");
      gl.linkProgram(program);
      if (!gl.getProgramParameter(program, gl.LINK_STATUS))
        throw new Error(gl.getProgramInfoLog(program));
      this.at = new Proxy(
        {},
        { get: (kept, name) => (kept[name] ??= gl.getUniformLocation(program, name)) },
      );
      return program;
    }

    drawn(piece) {
      // its vertex array; pieces of one form share one
      const key = JSON.stringify([
        piece.kind,
        piece.mesh,
        piece.kind === "capsule" || piece.kind === "cylinder" ? [piece.size, piece.taper] : 0,
      ]);
      if (this.solids.has(key)) return this.solids.get(key);
      const gl = this.gl,
        [places, normals, faces] = solid(piece, this.scene.meshes),
        array = gl.createVertexArray();
      gl.bindVertexArray(array);
      [places, normals].forEach((values, i) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
        gl.enableVertexAttribArray(i);
        gl.vertexAttribPointer(i, 3, gl.FLOAT, false, 0, 0);
      });
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(faces), gl.STATIC_DRAW);
      gl.bindVertexArray(null);
      const found = { array, count: faces.length, places, faces };
      this.solids.set(key, found);
      return found;
    }

    // Look at all of the motion from the usual side.
    fit() {
      const side = { x: [0.42, 0.8, -1], y: [0.55, 0.4, 1], z: [0.55, -1, 0.4] }[this.scene.up];
      this.target = add(this.scene.center, this.gone || [0, 0, 0]);
      const away = unit(side);
      this.elevation = Math.asin(dot(away, this.up));
      this.east = unit(cross(this.up, Math.abs(this.up[0]) > 0.5 ? [0, 0, 1] : [1, 0, 0]));
      this.north = cross(this.up, this.east);
      this.azimuth = Math.atan2(dot(away, this.north), dot(away, this.east));
      this.sun = unit(add(add(this.up, away, 0.45), cross(this.up, away), 0.5));
      const ratio = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
      this.distance = (1.25 * this.scene.size) / Math.min(ratio, 1);
    }

    // A mechanism that travels stays in the middle.
    follow(places) {
      if (!this.scene.travels) return;
      const start = this.scene.start,
        gone = [0, 1, 2].map((i) => (this.up[i] ? 0 : places[i] - start[i]));
      this.target = add(sub(this.target, this.gone || [0, 0, 0]), gone);
      this.gone = gone;
    }

    get eye() {
      const c = Math.cos(this.elevation);
      let away = add([0, 0, 0], this.east, c * Math.cos(this.azimuth));
      away = add(away, this.north, c * Math.sin(this.azimuth));
      away = add(away, this.up, Math.sin(this.elevation));
      return add(this.target, away, this.distance);
    }

    camera() {
      const rise =
        (this.scene.low + 0.01 * this.scene.size - dot(this.target, this.up)) / this.distance;
      this.elevation = Math.max(this.elevation, Math.asin(Math.min(Math.max(rise, -1), 0.9))); // above the ground
      const eye = this.eye,
        z = unit(sub(eye, this.target)),
        x = unit(cross(this.up, z)),
        y = cross(z, x);
      const look = new Float32Array([
        x[0],
        y[0],
        z[0],
        0,
        x[1],
        y[1],
        z[1],
        0,
        x[2],
        y[2],
        z[2],
        0,
        -dot(x, eye),
        -dot(y, eye),
        -dot(z, eye),
        1,
      ]);
      const near = this.distance / 100,
        far = this.distance * 40,
        f = 1 / Math.tan(0.35),
        w = this.canvas.width / this.canvas.height;
      const lens = new Float32Array([
        f / w,
        0,
        0,
        0,
        0,
        f,
        0,
        0,
        0,
        0,
        (far + near) / (near - far),
        -1,
        0,
        0,
        (2 * far * near) / (near - far),
        0,
      ]);
      this.frame = { x, y, z, eye, f, w };
      return times(lens, look);
    }

    placed(piece, places, turns) {
      // the matrix of a piece: its body's pose, then its own
      const b = 3 * piece.body,
        r = turns.subarray(3 * b, 3 * b + 9),
        m = new Float32Array(16);
      const scale =
        piece.kind === "box" || piece.kind === "sphere"
          ? piece.size
          : piece.kind === "mesh"
            ? piece.size
            : [1, 1, 1];
      for (let j = 0; j < 3; j++)
        for (let i = 0; i < 3; i++)
          m[4 * j + i] =
            scale[j] *
            (r[3 * i] * piece.rotation[j] +
              r[3 * i + 1] * piece.rotation[3 + j] +
              r[3 * i + 2] * piece.rotation[6 + j]);
      for (let i = 0; i < 3; i++)
        m[12 + i] =
          places[b + i] +
          r[3 * i] * piece.position[0] +
          r[3 * i + 1] * piece.position[1] +
          r[3 * i + 2] * piece.position[2];
      m[15] = 1;
      return m;
    }

    draw(pieces, places, turns, grip) {
      const { gl, canvas, at, scene, up } = this,
        ratio = Math.min(window.devicePixelRatio || 1, 2);
      const [w, h] = [canvas.clientWidth, canvas.clientHeight].map((x) =>
        Math.max(1, Math.round(x * ratio)),
      );
      if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
      const camera = this.camera(),
        theme = this.theme(),
        sun = this.sun;
      gl.viewport(0, 0, w, h);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
      gl.useProgram(this.program);
      gl.enable(gl.DEPTH_TEST);
      gl.uniformMatrix4fv(at.camera, false, camera);
      gl.uniform3fv(at.eye, this.frame.eye);
      gl.uniform3fv(at.sun, sun);
      gl.uniform3fv(at.up, up);
      gl.uniform1f(at.cell, scene.cell);
      gl.uniform1f(at.far, 14 * scene.size);
      gl.uniform3fv(at.line, theme.line);
      const models = pieces.map((piece) => this.placed(piece, places, turns));
      this.models = models;
      const drawn = (piece, model) => {
        const one = this.drawn(piece);
        gl.uniformMatrix4fv(at.model, false, model);
        gl.bindVertexArray(one.array);
        gl.drawElements(gl.TRIANGLES, one.count, gl.UNSIGNED_INT, 0);
      };
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      const floor = add(
        add([0, 0, 0], sub(this.target, add([0, 0, 0], up, dot(this.target, up)))),
        up,
        scene.low - 0.002 * scene.size,
      );
      const plate = { body: 0, kind: "box", size: [1, 1, 1], taper: 1 };
      const wide = 30 * scene.size,
        thick = 1e-4 * scene.size,
        m = new Float32Array(16);
      for (let i = 0; i < 3; i++) {
        m[5 * i] = up[i] ? thick : wide;
        m[12 + i] = floor[i] - up[i] * thick;
      }
      m[15] = 1;
      gl.uniform1f(at.mode, 1);
      gl.uniform4fv(at.color, [...theme.ground, 1]);
      drawn(plate, m);
      const flat = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        fall = dot(sun, up);
      for (let j = 0; j < 3; j++)
        for (let i = 0; i < 3; i++) flat[4 * j + i] -= (sun[i] * up[j]) / fall;
      for (let i = 0; i < 3; i++) flat[12 + i] = (sun[i] / fall) * (scene.low - 0.001 * scene.size);
      gl.uniform1f(at.mode, 2);
      gl.uniform4fv(at.color, [0, 0, 0, 0.2]);
      gl.enable(gl.STENCIL_TEST);
      gl.stencilFunc(gl.EQUAL, 0, 255);
      gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
      pieces.forEach((piece, i) => drawn(piece, times(flat, models[i])));
      gl.disable(gl.STENCIL_TEST);
      gl.uniform1f(at.mode, 0);
      const behind = pieces.map((_, i) => i).sort((i, j) => pieces[j].opacity - pieces[i].opacity);
      for (const i of behind) {
        // what is seen through others is drawn before them
        gl.uniform4fv(at.color, [...pieces[i].color.map((c) => c / 255), pieces[i].opacity]);
        drawn(pieces[i], models[i]);
      }
      if (grip) {
        gl.uniform4fv(at.color, [0.9, 0.4, 0.05, 1]);
        const way = sub(grip.target, grip.from),
          long = Math.hypot(...way),
          thin = 0.008 * scene.size;
        if (long > thin) {
          const z = unit(way),
            x = unit(cross(Math.abs(z[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], z)),
            y = cross(z, x);
          const rod = new Float32Array([
            ...x.map((c) => c * thin),
            0,
            ...y.map((c) => c * thin),
            0,
            ...way,
            0,
            ...add(grip.from, way, 0.5),
            1,
          ]);
          drawn(plate, rod);
        }
      }
      gl.bindVertexArray(null);
    }

    ray(event) {
      const box = this.canvas.getBoundingClientRect(),
        { x, y, z, eye, f, w } = this.frame;
      const sx = ((event.clientX - box.left) / box.width) * 2 - 1,
        sy = 1 - ((event.clientY - box.top) / box.height) * 2;
      return { eye, way: unit(add(add(add([0, 0, 0], z, -f), x, sx * w), y, sy)) };
    }

    // {piece, point} where a ray meets a piece first; null.
    hit(pieces, { eye, way }) {
      let best = null,
        nearest = Infinity;
      pieces.forEach((piece, i) => {
        const { places, faces } = this.drawn(piece),
          m = this.models[i];
        const put = (k) =>
          [0, 1, 2].map(
            (r) =>
              m[r] * places[3 * k] +
              m[4 + r] * places[3 * k + 1] +
              m[8 + r] * places[3 * k + 2] +
              m[12 + r],
          );
        for (let k = 0; k < faces.length; k += 3) {
          const a = put(faces[k]),
            u = sub(put(faces[k + 1]), a),
            v = sub(put(faces[k + 2]), a);
          const n = cross(way, v),
            det = dot(u, n);
          if (Math.abs(det) < 1e-14) continue;
          const from = sub(eye, a),
            s = dot(from, n) / det,
            c = cross(from, u),
            t = dot(way, c) / det,
            d = dot(v, c) / det;
          if (s >= 0 && t >= 0 && s + t <= 1 && d > 0 && d < nearest) {
            nearest = d;
            best = { piece, point: add(eye, way, d) };
          }
        }
      });
      return best;
    }

    // Where the ray meets the plane through a point that faces the viewer.
    facing(event, point) {
      const { eye, way } = this.ray(event),
        { z } = this.frame;
      return add(eye, way, dot(sub(point, eye), z) / dot(way, z));
    }

    turn(dx, dy) {
      this.azimuth -= dx;
      this.elevation = Math.min(1.5, Math.max(-1.5, this.elevation + dy));
    }

    zoom(by) {
      this.distance = Math.min(
        Math.max(this.distance * by, 0.05 * this.scene.size),
        60 * this.scene.size,
      );
    }

    // Drags turn the view, or pull where `grab(event)` takes hold of something.
    listen() {
      const fingers = new Map(),
        { canvas } = this;
      let apart = 0;
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        fingers.set(event.pointerId, event);
        this.held =
          fingers.size === 1 && event.button === 0 && !event.shiftKey && !!this.grab?.(event);
        if (fingers.size > 1) this.letGo?.();
      });
      canvas.addEventListener(
        "touchstart",
        (event) => {
          // one finger up or down scrolls the page
          if (this.held || event.touches.length > 1) event.preventDefault();
        },
        { passive: false },
      );
      canvas.addEventListener("pointermove", (event) => {
        const before = fingers.get(event.pointerId);
        if (!before) return;
        const dx = event.clientX - before.clientX,
          dy = event.clientY - before.clientY;
        fingers.set(event.pointerId, event);
        if (fingers.size === 2) {
          const [a, b] = [...fingers.values()],
            now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
          if (apart) this.zoom(apart / now);
          apart = now;
        } else if (this.held) this.drag?.(event);
        else if (event.buttons & 2 || event.shiftKey) {
          const s = (0.7 * this.distance) / canvas.clientHeight;
          this.target = add(add(this.target, this.frame.x, -dx * s), this.frame.y, dy * s);
        } else this.turn(0.008 * dx, 0.008 * dy);
      });
      const end = (event) => {
        fingers.delete(event.pointerId);
        apart = 0;
        if (this.held) this.letGo?.();
        this.held = false;
      };
      canvas.addEventListener("pointerup", end);
      canvas.addEventListener("pointercancel", end);
      canvas.addEventListener("contextmenu", (event) => event.preventDefault());
      canvas.addEventListener(
        "wheel",
        (event) => {
          event.preventDefault();
          this.zoom(Math.exp(0.001 * event.deltaY));
        },
        { passive: false },
      );
    }
  }

  return { View };
})();
