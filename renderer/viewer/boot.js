// Classic script: gathers the data scripts, gives the modules their addresses, starts the page.
(() => {
  "use strict";
  const packed = new Map();
  const byId = (id) => document.getElementById(id);
  window.paceViewerData = (key, text) => packed.set(key, text);

  window.paceViewerFail = (headline, detail) => {
    byId("cover").hidden = false;
    byId("cover").dataset.state = "error";
    byId("cover-spinner").hidden = true;
    byId("cover-text").textContent = headline;
    byId("cover-detail").textContent = detail ?? "";
    document.documentElement.dataset.state = "error";
  };

  function say(text) {
    byId("cover-text").textContent = text;
  }

  function loadScript(name) {
    return new Promise((resolve, reject) => {
      const script = document.createElement("script");
      script.src = `data/${name}.js`;
      script.onload = () => resolve();
      script.onerror = () => reject(new Error(`data/${name}.js is missing. Keep index.html and its folders together.`));
      document.head.append(script);
    });
  }

  async function unpack(key) {
    const text = packed.get(key);
    if (text === undefined) throw new Error(`data/${key}.js is damaged: it holds no data.`);
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    packed.delete(key);
    try {
      const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
      return await new Response(stream).arrayBuffer();
    } catch {
      throw new Error(`data/${key}.js is damaged: it cannot be unpacked.`);
    }
  }

  // Modules have no addresses in a page opened from the disk. Each becomes a blob, and its imports
  // are pointed to the blobs before it.
  function address(modules) {
    const blobs = new Map();
    for (const [name, source] of modules) {
      const linked = source.replace(/(\bfrom\s*)(['"])([^'"\n]+)\2/g, (whole, from, quote, wanted) => {
        const target = wanted === "three" ? "three.module.js" : wanted.split("/").at(-1);
        return blobs.has(target) ? `${from}"${blobs.get(target)}"` : whole;
      });
      const file = name.split("/").at(-1);
      blobs.set(file, URL.createObjectURL(new Blob([linked], { type: "text/javascript" })));
    }
    return blobs.get("app.js");
  }

  async function start() {
    const manifest = JSON.parse(byId("manifest").textContent);
    if (typeof DecompressionStream === "undefined") {
      throw new Error("This browser is too old: Chrome 80, Firefox 113 or Safari 16.4 is needed.");
    }
    say("Loading the viewer");
    await loadScript("program");
    const modules = JSON.parse(new TextDecoder().decode(await unpack("program")));
    const data = new Map();
    const keys = ["room", ...manifest.bodies.map((body) => body.key)];
    for (const [index, key] of keys.entries()) {
      const label = index === 0 ? "room" : manifest.bodies[index - 1].label;
      say(`Loading ${label} (${index + 1} of ${keys.length})`);
      await loadScript(key);
      data.set(key, await unpack(key));
    }
    const { startViewer } = await import(address(modules));
    await startViewer(manifest, data);
    byId("cover").hidden = true;
    document.documentElement.dataset.state = "ready";
  }

  const ready = start();
  ready.catch((error) => window.paceViewerFail("The viewer cannot start", error.message));
  window.paceViewer = { ready };
})();
