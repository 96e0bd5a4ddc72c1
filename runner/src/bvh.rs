//! `runner bvh`: binary trees in files.

use crate::{
    args::{Global, Precompute},
    commands::print,
    params::Params,
    session::{Loaded, Session},
    table::thousands,
    variant::Variant,
};
use anyhow::Context;
use tracer::{
    builder::{Builder, Method},
    bvh2::Bvh2,
    layout::Layout,
    scene::sha256,
    treefile::{self, Made},
};

/// Builds a scene's binary tree and stores it.
///
/// # Errors
/// The scene cannot be loaded, the tree not be built, or the file not be written.
pub fn precompute(global: &Global, arguments: &Precompute) -> anyhow::Result<()> {
    let mut params = Params::with(Variant::BINARY, &arguments.tuning.set)?;
    if let Some(build) = arguments.build {
        params.build.method = build.into();
    }
    let session = Session::open(global)?;
    let loaded = session.load(&arguments.scene)?;
    let scene = &loaded.scene;
    let store = |tree: &Bvh2, seconds: f64| -> anyhow::Result<()> {
        let made = Made { scene: scene.name.clone(), recipe: params.recipe(), seconds };
        let content = treefile::content(&scene.positions);
        let bytes = treefile::encode(tree, &made, &content, scene.positions.len());
        let path = &arguments.output;
        record::replace(path, |out| out.write_all(&bytes))
            .with_context(|| format!("cannot write {}", path.display()))?;
        print(&format!(
            "{}: {} leaves over {} triangles, built by {} in {seconds:.3} s\n{}: {} bytes, sha256 {}",
            scene.name,
            thousands(tree.leaves as u64),
            thousands(scene.positions.len() as u64),
            params.build.method,
            path.display(),
            thousands(bytes.len() as u64),
            sha256(&bytes)
        ))
    };
    match params.build.method {
        Method::Ploc | Method::Hploc => {
            let (tree, seconds) = clustered(&session, &loaded, &params)?;
            store(&tree, seconds)?;
        }
        Method::Sbvh | Method::Midpoint => {
            let built = loaded.built_on_cpu(&params.recipe(), session.quiet);
            store(&built.tree, 1e-3 * built.milliseconds)?;
        }
    }
    session.finish()
}

/// The tree that the device builds, and the seconds that this took.
fn clustered(session: &Session, loaded: &Loaded, params: &Params) -> anyhow::Result<(Bvh2, f64)> {
    let context = || format!("building the tree of {}", loaded.scene.name);
    let builder =
        Builder::new(&session.gpu, &params.build(Variant::BINARY), Layout::Binary).with_context(context)?;
    let count = loaded.device.triangles;
    let workspace = builder.workspace(count).with_context(context)?;
    let build = || builder.build(&workspace, &loaded.device.positions, count, false).with_context(context);
    // The first dispatches may contain their compilation.
    build()?;
    let took = build()?.milliseconds;
    let seconds = 1e-3 * (took.morton + took.sort + took.ploc + took.hploc);
    Ok((workspace.read_tree()?.in_levels(), seconds))
}
