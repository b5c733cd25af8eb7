// Sends chosen or dropped files one after the other, whole and unwrapped, and says what became of each.
(() => {
  const part = (id) => document.getElementById(id);

  function send(file) {
    return new Promise((done) => {
      const request = new XMLHttpRequest();
      request.open("PUT", "/upload?name=" + encodeURIComponent(file.name));
      request.upload.onprogress = (event) => { part("upload-progress").value = event.loaded / event.total; };
      request.onload = () => done(request.responseText);
      request.onerror = () => done(file.name + ": the connection was lost, nothing was kept. Try it again.");
      request.send(file);
    });
  }

  async function sendAll(files) {
    const told = [];
    for (const file of files) {
      part("upload-progress").hidden = false;
      part("upload-status").textContent = [...told, file.name + " ..."].join("\n");
      told.push(await send(file));
    }
    part("upload-progress").hidden = true;
    part("upload-status").textContent = told.join("\n");
    part("files").value = "";
  }

  document.addEventListener("change", (event) => {
    if (event.target.id === "files") sendAll([...event.target.files]);
  });
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    sendAll([...event.dataTransfer.files]);
  });
})();
