// @ts-check
/**
 * Replaces the document of the frame by the robot's page, as the worker renders it. A classic script:
 * the page's import map must come before any module.
 */
void (async () => {
  const host = /** @type {any} */ (window.parent).urcPlayground;
  if (window.parent === window || !host) return;
  const html = await host.page(location.search.slice(1));
  document.open();
  document.write(html);
  document.close();
})();
