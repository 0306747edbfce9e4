// The stage: soft shadows from two lights, a floor whose lines fade into the canvas, what the light does
// to bodies and arrows, and the values of forces.
pgraph.stage = (() => {
  const { make, viser } = pgraph;
  const FRAGMENT = `
    #include <common>
    #include <packing>
    #include <bsdfs>
    #include <lights_pars_begin>
    #include <shadowmap_pars_fragment>
    #include <shadowmask_pars_fragment>
    varying vec3 localPosition;
    varying vec4 worldPosition;
    uniform vec3 centre, cellColor, planeColor;
    uniform float cellSize, sectionSize, fadeStrength, shadowOpacity;
    float lines(float size, float width) {
      vec2 r = localPosition.xz / size, q = abs(fract(r - .5) - .5) / fwidth(r);
      return 1. - min(min(q.x, q.y) / width, 1.);
    }
    void main() { // distances in sizes of the model
      float d = distance(localPosition.xz, centre.xz) / fadeStrength, far = exp(-.020 * d * d), near = exp(-.11 * d * d);
      float line = max(lines(cellSize, 1.) * .24, lines(sectionSize, 1.2) * .55) * near;
      float shadow = (1. - getShadowMask()) * shadowOpacity * far, alpha = 1. - (1. - far) * (1. - shadow) * (1. - line);
      vec3 colour = mix(mix(planeColor * far, vec3(0.), shadow), cellColor, line);
      if (alpha < .004) discard;
      gl_FragColor = vec4(colour / alpha, alpha);
      #include <colorspace_fragment>
    }`;
  const BACK = 1,
    GREATER = 6; // of three.js
  const node = (name) => window.__viserMutable?.nodeRefFromName[name];

  // The middle of what is seen, and how much of it [m].
  function seen() {
    const controls = viser.controls();
    if (!controls) return null;
    const { camera } = controls,
      middle = controls.getTarget(camera.position.clone(), false);
    camera.updateMatrixWorld();
    const half = Math.tan((camera.fov * Math.PI) / 360) * camera.position.distanceTo(middle);
    return { middle, radius: 1.15 * half * Math.max(1, camera.aspect) };
  }

  // name -> size of its map, radius of its blur in pixels, and how dark its shadow is
  const SHADOWS = { key: [2048, 2.5, 1], sky: [512, 5, 0.25] };
  function shade(name, [pixels, radius, intensity], { middle, radius: reach }) {
    const group = node(`/light/${name}`);
    const light = group?.children.find(({ isDirectionalLight }) => isDirectionalLight);
    if (!light) return;
    const { shadow } = light,
      { camera } = shadow;
    if (!light.castShadow) {
      light.castShadow = true;
      shadow.mapSize.set(pixels, pixels);
      Object.assign(shadow, { radius, intensity });
    }
    Object.assign(shadow, { bias: -4e-4, normalBias: (3 * reach) / pixels });
    if (camera.right !== reach) {
      Object.assign(camera, {
        left: -reach,
        right: reach,
        bottom: -reach,
        top: reach,
        near: 0.01 * reach,
        far: 12 * reach,
      });
      camera.updateProjectionMatrix();
    }
    const way = group.getWorldPosition(middle.clone()).normalize();
    light.position.copy(group.worldToLocal(way.multiplyScalar(6 * reach).add(middle)));
    light.target.position.copy(middle);
    light.target.updateMatrixWorld();
  }
  function floor(mesh, { middle }) {
    const { material } = mesh;
    if (!material) return;
    // its triangles are turned, so that its back is above; from below it is not drawn. viser sets the side again by itself
    if (material.fragmentShader !== FRAGMENT || material.side !== BACK)
      Object.assign(material, { fragmentShader: FRAGMENT, side: BACK, needsUpdate: true });
    (material.uniforms.centre ??= { value: middle.clone() }).value.copy(
      mesh.worldToLocal(middle.clone()),
    );
  }
  viser.frame(() => {
    const at = seen();
    if (!at) return;
    for (const name in SHADOWS) shade(name, SHADOWS[name], at);
    node("/floor")?.traverse((mesh) => floor(mesh, at));
  });

  // viser's background is black until its picture is loaded: until then the canvas of the page shows through.
  viser.frame(() => {
    const { enabled, colorMap } = window.__viserMutable.backgroundMaterial?.uniforms ?? {};
    if (enabled) enabled.value = Boolean(colorMap.value);
  });

  // A colour of the style, of the theme that the page has now.
  let tones = {};
  const tone = (name) =>
    (tones[name] ??= getComputedStyle(document.querySelector(".pgraph"))
      .getPropertyValue(name)
      .trim());
  pgraph.on("theme", () => {
    tones = {};
  });

  // Bodies are matte porcelain; what is selected is seen through others.
  for (const name of ["/bodies", "/selected"])
    viser.materials(name, (material) => {
      if (material.roughness === 1) material.roughness = 0.5;
    });
  // In the accent, faintly where something else is before it, and over all of it its mass centre.
  const ORDER = { behind: 1, fill: 2, centre: 3 }, // arrows come after them
    WHITE = { fill: 0.12, centre: 1 }, // of the colour
    GLOW = { fill: 0.3, behind: 1 };
  viser.frame(() => {
    for (let k = 0; node(`/selected/${k}`); k++)
      for (const part of ["outline", "behind", "fill", "centre"])
        node(`/selected/${k}/${part}`)?.traverse((mesh) => paint(part, mesh));
  });
  function paint(part, mesh) {
    const { material } = mesh;
    if (!material?.color) return;
    if (part === "outline") {
      outline(material);
      return;
    }
    mesh.renderOrder = ORDER[part];
    material.color.set(tone("--accent"));
    material.emissive?.set(tone("--accent")); // also in the shade
    if (material.emissive) material.emissiveIntensity = GLOW[part] ?? 0;
    if (WHITE[part]) material.color.lerp(material.color.clone().setScalar(1), WHITE[part]);
    if (part === "behind") Object.assign(material, { depthFunc: GREATER, depthWrite: false });
    else if (!material.transparent)
      Object.assign(material, { transparent: true, depthTest: part === "fill", needsUpdate: true });
  }
  // The connection that is open has the accent, faint where a body is before it.
  viser.frame(() => {
    for (const kind of Object.keys(pgraph.latest.joined ?? {}))
      for (const part of ["behind", "fill"])
        node(`/opened/${kind}/${part}`)?.traverse((mesh) => {
          const { material } = mesh;
          if (!material?.emissive) return;
          mesh.renderOrder = ORDER[part];
          material.color.setScalar(0);
          material.emissive.set(tone("--accent"));
          if (part === "behind") Object.assign(material, { depthFunc: GREATER, depthWrite: false });
          if (material.toneMapped)
            Object.assign(material, { toneMapped: false, needsUpdate: true });
        });
  });
  // The back of a body, as many pixels larger on all sides.
  const WIDTH = 2; // [px]
  const canvas = { value: [1, 1] };
  function outline(material) {
    const { clientWidth, clientHeight } = document.querySelector("canvas:not(.pgraph *)");
    canvas.value = [(2 * WIDTH) / clientWidth, (2 * WIDTH) / clientHeight];
    material.color.setScalar(0);
    material.emissive.set(tone("--accent"));
    if (material.userData.outline) return;
    material.userData.outline = true;
    Object.assign(material, { toneMapped: false, needsUpdate: true });
    material.onBeforeCompile = (shader) => {
      shader.uniforms.pixels = canvas;
      shader.vertexShader = `uniform vec2 pixels;\n${shader.vertexShader.replace(
        "#include <project_vertex>",
        `#include <project_vertex>
        vec2 way = (normalMatrix * objectNormal).xy;
        gl_Position.xy += pixels * gl_Position.w * way / max(length(way), 1e-6);`,
      )}`;
    };
  }
  // An arrow has a colour without light. It acts inside of bodies, so nothing hides it.
  for (const [arrows, colour] of [
    ["/forces", "--force"],
    ["/loads", "--s1"],
    ["/pull", "--accent"],
  ]) {
    viser.frame(() =>
      node(arrows)?.traverse((mesh) => {
        mesh.renderOrder = 4;
      }),
    );
    viser.materials(arrows, (material) => {
      if (!material.transparent)
        Object.assign(material, {
          transparent: true,
          toneMapped: false,
          depthTest: false,
          needsUpdate: true,
        });
      material.color.setScalar(0);
      material.emissive.set(tone(colour));
    });
  }

  // -- one hover: the body is lit in 3D, its row and node are marked, its name is at the pointer ----
  const HOVERED = 0.3; // of the accent's light
  const label = make("div", { className: "pgraph pgraph-pill hover", hidden: true });
  const BODIES = "bodies";
  let hovered = null, // name, in the list of the model that `list` names
    list = BODIES,
    inView = false,
    pointer = [0, 0],
    overView = false; // viser may be late to say that the pointer has left
  const names = () => pgraph.latest.digraph?.names ?? [];
  function hover(name, ofView = false, of = BODIES) {
    if (name !== hovered || of !== list) {
      for (const el of document.querySelectorAll(".hovered")) el.classList.remove("hovered");
      const within = of === BODIES ? "" : `section[data-part="${of}"] `;
      if (name)
        for (const el of document.querySelectorAll(`${within}[data-name="${CSS.escape(name)}"]`))
          el.classList.add("hovered");
      [hovered, list] = [name, of];
      label.textContent = name;
      window.__viserMutable?.requestRender();
    }
    inView = Boolean(name) && ofView;
    label.hidden = !inView;
    [label.style.left, label.style.top] = [`${pointer[0] + 14}px`, `${pointer[1] + 16}px`];
  }
  window.addEventListener(
    "pointermove",
    ({ clientX, clientY, target }) => {
      pointer = [clientX, clientY];
      overView = target.tagName === "CANVAS" && !target.closest(".pgraph");
      const named = target.closest?.("tr[data-name], g.node[data-name], .entry[data-name]");
      if (named || !inView) hover(named?.dataset.name || null);
      else hover(hovered, true, list);
    },
    { passive: true },
  );
  viser.frame(() => {
    const lit = list === BODIES ? names().indexOf(hovered) + 1 : 0;
    let under = 0;
    for (let k = 1, body; (body = node(`/bodies/${k}`)); k++) {
      body.traverse(({ material, parent }) => {
        if (material?.uniforms?.thickness) {
          // viser's own outline says what is under the pointer, and is not drawn
          material.visible = false;
          if (parent.visible) under = k;
        } else if (material?.emissive)
          Object.assign(material, { emissiveIntensity: HOVERED }).emissive.set(
            k === lit ? tone("--accent") : 0,
          );
      });
    }
    const joined = overView && underPointer();
    if (under && overView) hover(names()[under - 1] ?? null, true);
    else if (joined) hover(joined[1], true, joined[0]);
    else if (inView) hover(null);
  });
  // Of a batch the outline of the instance is drawn.
  for (const name of ["/bodies", "/joining"])
    viser.materials(name, ({ uniforms }) => {
      if (!uniforms?.thickness) return;
      uniforms.thickness.value = 3;
      uniforms.color.value.set(tone("--accent"));
    });
  // [list, name] of the connection that viser outlines, or null.
  function underPointer() {
    let found = null;
    for (const kind of Object.keys(pgraph.latest.joined ?? {}))
      node(`/joining/${kind}`)?.traverse((mesh) => {
        if (mesh.material?.uniforms?.thickness && mesh.visible && mesh.material.visible)
          found = named(kind, mesh.position) ?? found;
      });
    return found;
  }
  // Between the turns of a spring the pointer is on it, too: it is on the prism around each instance.
  const SIDES = 12;
  function prism({ constructor: Geometry, attributes, boundingBox }) {
    const { min, max } = boundingBox,
      turn = (k) => (2 * Math.PI * (k % SIDES)) / SIDES;
    const corner = (k, z) => [max.x * Math.cos(turn(k)), max.y * Math.sin(turn(k)), z];
    const sides = [...Array(SIDES).keys()].flatMap((k) => {
      const [a, b] = [corner(k, min.z), corner(k + 1, min.z)],
        [c, d] = [corner(k, max.z), corner(k + 1, max.z)];
      return [a, b, d, a, d, c, [0, 0, max.z], c, d, [0, 0, min.z], b, a];
    });
    const { constructor: Attribute } = attributes.position;
    return new Geometry().setAttribute(
      "position",
      new Attribute(new Float32Array(sides.flat()), 3),
    );
  }
  function aroundTurns(raycaster, hits) {
    const own = this._geometry;
    if (!own.boundingBox) own.computeBoundingBox();
    this._geometry = this.userData.prism ??= prism(own);
    Object.getPrototypeOf(this).raycast.call(this, raycaster, hits);
    this._geometry = own;
  }
  // While bodies or points are picked, the pointer goes through all connections.
  function passThrough() {
    const { aim, constraints, joined = {} } = pgraph.latest,
      through = Boolean(aim || constraints?.picking);
    for (const kind of Object.keys(joined))
      node(`/joining/${kind}`)?.traverse((mesh) => {
        if (mesh.material?.uniforms?.thickness) mesh.material.visible = !through;
        else if (mesh.instancesCount === undefined) return;
        else if (through) mesh.raycast = () => {};
        else if (kind === "springs") mesh.raycast = aroundTurns;
        else delete mesh.raycast;
      });
  }
  for (const topic of ["aim", "constraints"]) pgraph.on(topic, passThrough);
  viser.frame(passThrough);
  // The part of the instance at a place: [list, name].
  function named(kind, { x, y, z }) {
    const at =
      window.__viserSceneTree.getState()[`/joining/${kind}`]?.message.props.batched_positions;
    let last = 0;
    for (const [of, name, count] of pgraph.latest.joined[kind])
      for (const end = last + count; last < end; last++)
        if (at?.[3 * last] === x && at[3 * last + 1] === y && at[3 * last + 2] === z)
          return name ? [of, name] : null;
    return null;
  }

  // -- values at the heads of arrows: the largest first, none over another ----------------------------
  const APART = [52, 20]; // [px]
  const pills = make("div", { className: "pgraph pgraph-pills" });
  const pill = () => {
    const button = make("button", { className: "pgraph-pill" });
    button.onclick = () => pgraph.send("OpenPart", button.pgraphPart);
    return button;
  };
  pgraph.on("forces", (values) => {
    while (pills.children.length > values.length) pills.lastChild.remove();
    while (pills.children.length < values.length) pills.append(pill());
    values.forEach(([, , , text, part, name], i) => {
      const button = pills.children[i]; // one that is pressed while values move stays
      if (button.textContent !== text) button.textContent = text;
      button.title = `${name}: open it`;
      button.pgraphPart = { part, name };
    });
    put();
  });
  function put() {
    const there = [],
      box = pills.getBoundingClientRect();
    (pgraph.latest.forces ?? []).forEach((value, i) => {
      const place = pgraph.picking.projected(value.slice(0, 3)),
        pill = pills.children[i];
      const free =
        place &&
        there.every((other) => APART.some((least, k) => Math.abs(other[k] - place[k]) > least));
      pill.hidden = !free;
      if (!free) return;
      there.push(place);
      pill.style.translate = `${(place[0] - box.left).toFixed(1)}px ${(place[1] - box.top).toFixed(1)}px`;
    });
  }
  viser.frame(put);
  document.body.append(pills, label);
  return { tone };
})();
