//! Reads a controller's parameters as JSON from standard input and tracks a reference with it.

use ftc_control::{Controller, ControllerParameters};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let parameters: ControllerParameters = serde_json::from_reader(std::io::stdin())?;
    let model = parameters.modes[0].clone();
    let controller = Controller::new(parameters)?;
    let mut state = controller.initial_state(0);
    let mut x = vec![0.0; model.x0.len()];
    let reference = vec![0.3; controller.parameters().feedback.tracked.len()];
    let mut y = vec![0.0; model.y0.len()];
    for tick in 0..400 {
        ftc_control::kernel::affine(&mut y, &model.y0, &model.c, &x);
        controller.tick(&mut state, &controller.sample(tick, 0, &y, &reference)?);
        let mut next = vec![0.0; x.len()];
        ftc_control::kernel::add_product(&mut next, &model.a, &x);
        ftc_control::kernel::add_product(&mut next, &model.b, &state.command);
        x = next;
    }
    println!("{}", serde_json::to_string(&y)?);
    Ok(())
}
