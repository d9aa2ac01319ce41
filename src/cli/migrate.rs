//! `hlacdb migrate`.
use super::{Context, Failure, Outcome};
use clap::Args;
/// Bring a store of an older format to this version's
#[derive(Args)]
pub(crate) struct Migrate;
impl Migrate {
    pub(crate) fn run(self, _context: &mut Context) -> Result<Outcome, Failure> {
        Ok(Outcome::Done)
    }
}
